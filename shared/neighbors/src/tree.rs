//! A tree of bounding boxes, eight to a node, over points in Morton order.

use crate::blocks::{BLOCK, Block};
use crate::morton::{Entry, MortonGrid};
use crate::position::Bounds;
use rayon::prelude::*;
use std::ops::Range;

/// Number of children of a node.
pub const WIDTH: usize = 8;

/// Marks a child that is a block.
const IS_BLOCK: u32 = 1 << 31;

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    Node(usize),
    Block(usize),
}

impl Child {
    /// The child of this number, as nodes store it.
    #[inline(always)]
    pub fn from_number(number: u32) -> Self {
        let index = (number & !IS_BLOCK) as usize;
        if number & IS_BLOCK == 0 { Self::Node(index) } else { Self::Block(index) }
    }
}

/// Boxes of eight children. The box of an unused slot is empty, therefore infinitely far away.
#[derive(Clone, Debug)]
pub struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    /// Numbers for [`Child::from_number`].
    pub child: [u32; WIDTH],
    /// The child's points in the order of the index: first, and one past the last.
    pub points: [[u32; 2]; WIDTH],
}

impl Node {
    const UNUSED: Self = Self {
        low: [[f32::INFINITY; WIDTH]; 3],
        high: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [0; WIDTH],
        points: [[0; 2]; WIDTH],
    };

    /// A lower bound of the squared distance to the points in each box. It also holds after rounding: `f32`
    /// subtraction, multiplication and addition are monotonic.
    #[inline(always)]
    pub fn squared_distances(&self, q: [f32; 3]) -> [f32; WIDTH] {
        let mut squared = [0.0; WIDTH];
        for (slot, squared) in squared.iter_mut().enumerate() {
            let d: [f32; 3] = std::array::from_fn(|axis| {
                let below = self.low[axis][slot] - q[axis];
                let above = q[axis] - self.high[axis][slot];
                let outside = if below > above { below } else { above };
                if outside > 0.0 { outside } else { 0.0 }
            });
            *squared = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
        }
        squared
    }
    /// An upper bound of the squared distance to the points in each box.
    #[inline(always)]
    pub fn squared_reaches(&self, q: [f32; 3]) -> [f32; WIDTH] {
        let mut squared = [0.0; WIDTH];
        for (slot, squared) in squared.iter_mut().enumerate() {
            let d: [f32; 3] = std::array::from_fn(|axis| {
                let to_low = q[axis] - self.low[axis][slot];
                let to_high = self.high[axis][slot] - q[axis];
                if to_low > to_high { to_low } else { to_high }
            });
            *squared = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
        }
        squared
    }
    fn bounds(&self) -> Bounds {
        (0..WIDTH).map(|slot| self.bounds_of(slot)).fold(Bounds::EMPTY, Bounds::union)
    }
    fn bounds_of(&self, slot: usize) -> Bounds {
        Bounds { low: self.low.map(|lows| lows[slot]), high: self.high.map(|highs| highs[slot]) }
    }
    fn set_bounds(&mut self, slot: usize, bounds: Bounds) {
        for axis in 0..3 {
            self.low[axis][slot] = bounds.low[axis];
            self.high[axis][slot] = bounds.high[axis];
        }
    }
}

/// The tree. Node 0 is the root; children follow their parents.
#[derive(Clone, Debug)]
pub struct Tree {
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
}

impl Tree {
    /// Builds the tree over sorted entries. If more entries than a block have equal codes, they are sorted further.
    pub fn over(points: &[[f32; 3]], entries: &mut [Entry]) -> Self {
        let mut outline = Outline { points, nodes: Vec::new(), blocks: Vec::new() };
        outline.add_node(entries, 0);
        let Outline { mut nodes, blocks: ranges, .. } = outline;
        let block_of = |range: &Range<u32>| {
            let entries = &entries[range.start as usize..range.end as usize];
            let block = Block::new(range.start, entries.iter().map(|entry| points[entry.point as usize]));
            let bounds = block.bounds();
            (block, bounds)
        };
        let (blocks, bounds): (Vec<Block>, Vec<Bounds>) = ranges.par_iter().map(block_of).unzip();
        for node_idx in (0..nodes.len()).rev() {
            for slot in 0..WIDTH {
                if nodes[node_idx].points[slot] == [0; 2] {
                    continue;
                }
                let child_bounds = match Child::from_number(nodes[node_idx].child[slot]) {
                    Child::Node(child) => nodes[child].bounds(),
                    Child::Block(block) => bounds[block],
                };
                nodes[node_idx].set_bounds(slot, child_bounds);
            }
        }
        Self { nodes, blocks }
    }
}

/// The tree without boxes.
struct Outline<'a> {
    points: &'a [[f32; 3]],
    nodes: Vec<Node>,
    blocks: Vec<Range<u32>>,
}

impl Outline<'_> {
    /// Adds the node of these entries, which begin at index `first`, and everything below it; returns its number.
    fn add_node(&mut self, entries: &mut [Entry], first: usize) -> u32 {
        let node_idx = self.nodes.len();
        self.nodes.push(Node::UNUSED);
        let mut ends = [entries.len(); WIDTH];
        let n_children = self.divide(entries, &mut ends);
        let mut start = 0;
        for (slot, end) in ends.into_iter().take(n_children).enumerate() {
            if start == end {
                continue;
            }
            let place = first + start;
            let child = if end - start <= BLOCK {
                self.blocks.push(place as u32..(first + end) as u32);
                (self.blocks.len() - 1) as u32 | IS_BLOCK
            } else {
                self.add_node(&mut entries[start..end], place)
            };
            let node = &mut self.nodes[node_idx];
            node.child[slot] = child;
            node.points[slot] = [place as u32, (first + end) as u32];
            start = end;
        }
        node_idx as u32
    }

    /// Repeatedly divides the largest part, into at most eight parts; sets their ends and returns their number.
    fn divide(&self, entries: &mut [Entry], ends: &mut [usize; WIDTH]) -> usize {
        let mut n_parts = 1;
        while n_parts < WIDTH {
            let start_of = |part: usize, ends: &[usize]| if part == 0 { 0 } else { ends[part - 1] };
            let length = |part: usize| ends[part] - start_of(part, ends);
            let largest = (1..n_parts).fold(0, |best, part| if length(part) > length(best) { part } else { best });
            if length(largest) <= BLOCK {
                break;
            }
            let start = start_of(largest, ends);
            let end = ends[largest];
            let middle = start + self.first_of_upper_half(&mut entries[start..end]);
            ends.copy_within(largest..n_parts, largest + 1);
            ends[largest] = middle;
            n_parts += 1;
        }
        n_parts
    }

    /// Index at which the cell around these entries is divided: at the highest bit in which their codes differ.
    fn first_of_upper_half(&self, entries: &mut [Entry]) -> usize {
        let first = 0;
        let last = entries.len() - 1;
        if entries[first].code == entries[last].code {
            let bounds = Bounds::around(entries.iter().map(|entry| self.points[entry.point as usize]));
            if bounds.extent() == 0.0 {
                // All entries are copies of one point.
                return entries.len() / 2;
            }
            // A distant outlier makes cells large; a separate grid divides these points.
            let grid = MortonGrid::from_bounds(bounds);
            for entry in entries.iter_mut() {
                entry.code = grid.code(self.points[entry.point as usize]);
            }
            entries.sort_unstable();
        }
        let bit = (entries[first].code ^ entries[last].code).ilog2();
        entries.partition_point(|entry| entry.code >> bit & 1 == 0)
    }
}
