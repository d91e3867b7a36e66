//! Nodes and voxels. All sides are powers of two in stored coordinates, mm, so cells are found by shifts.

use crate::las::position_of;
use rayon::prelude::*;

/// Blocks have sides of 2^16 mm, 65.5 m.
const BLOCK_BITS: u32 = 16;
/// The smallest nodes have sides of 2^11 mm, 2 m, and take all points that are left.
const DEEPEST_BITS: u32 = 11;
/// A node has 2^7 = 128 voxels a side.
const VOXEL_BITS: u32 = 7;
/// Number of words of the voxels of a node.
const N_WORDS: usize = 1 << (3 * VOXEL_BITS - 6);

/// Level below the root and cell within it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct NodeKey {
    pub(super) level: u32,
    pub(super) cell: [u32; 3],
}

impl NodeKey {
    /// The root, and the nodes from it to this one.
    pub(super) fn path_from_root(self) -> impl Iterator<Item = Self> {
        (0..=self.level).map(move |level| Self { level, cell: self.cell.map(|cell| cell >> (self.level - level)) })
    }
}

/// The block of stored coordinates.
pub(super) fn block_of(stored: [i32; 3]) -> [i16; 3] {
    stored.map(|value| (value >> BLOCK_BITS) as i16)
}

/// The cube of the root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Octree {
    /// Its lowest corner, stored coordinates.
    pub(super) low: [i32; 3],
    /// Base-2 logarithm of its side, stored coordinates.
    pub(super) side_bits: u32,
}

impl Octree {
    /// The smallest cube around blocks whose side is a power of two of blocks.
    pub(super) fn from_blocks(blocks: &[[i16; 3]]) -> Self {
        let low = [0, 1, 2].map(|axis| blocks.iter().map(|block| block[axis]).min().unwrap_or(0));
        let high = [0, 1, 2].map(|axis| blocks.iter().map(|block| block[axis]).max().unwrap_or(0));
        let widest = (0..3).map(|axis| (i32::from(high[axis]) - i32::from(low[axis]) + 1) as u32).max().unwrap_or(1);
        let side_bits = BLOCK_BITS + widest.next_power_of_two().trailing_zeros();
        Self { low: low.map(|cell| i32::from(cell) << BLOCK_BITS), side_bits }
    }

    /// Coordinates relative to the lowest corner.
    fn inside(&self, stored: [i32; 3]) -> [u32; 3] {
        std::array::from_fn(|axis| stored[axis].wrapping_sub(self.low[axis]) as u32)
    }

    fn corner(&self, block: [i16; 3]) -> [u32; 3] {
        self.inside(block.map(|cell| i32::from(cell) << BLOCK_BITS))
    }

    /// Blocks in the order of the octree: the blocks of a node are consecutive.
    pub(super) fn order(&self, mut blocks: Vec<[i16; 3]>) -> Vec<[i16; 3]> {
        blocks.sort_by_key(|block| {
            let corner = self.corner(*block);
            (BLOCK_BITS..self.side_bits).rev().fold(0_u64, |code, bit| code << 3 | octant(corner, bit) as u64)
        });
        blocks
    }

    /// Assigns a node to each record.
    pub(super) fn place(&self, root: &mut Node, records: &[u8], record_bytes: usize) -> Vec<NodeKey> {
        let inside: Vec<[u32; 3]> =
            records.chunks_exact(record_bytes).map(|record| self.inside(position_of(record))).collect();
        let all: Vec<u32> = (0..inside.len() as u32).collect();
        let mut keys = vec![NodeKey { level: 0, cell: [0; 3] }; inside.len()];
        for (i, level) in root.place(&all, &inside, self.side_bits, 0) {
            let cell = inside[i as usize].map(|value| (u64::from(value) >> (self.side_bits - level)) as u32);
            keys[i as usize] = NodeKey { level, cell };
        }
        keys
    }
}

/// Number from 0 to 7 of the octant that a bit of the coordinates selects.
#[inline]
fn octant(inside: [u32; 3], bit: u32) -> usize {
    let half = |axis: usize| (inside[axis] >> bit & 1) as usize;
    half(0) | half(1) << 1 | half(2) << 2
}

/// Occupied voxels of a node and of the nodes below it.
#[derive(Default)]
pub(super) struct Node {
    /// A bit for each voxel; empty before the first point.
    occupied: Vec<u64>,
    children: [Option<Box<Node>>; 8],
}

impl Node {
    /// Assigns levels to points, given by their numbers. `bits` is the side of this node.
    fn place(&mut self, points: &[u32], inside: &[[u32; 3]], bits: u32, level: u32) -> Vec<(u32, u32)> {
        if bits == DEEPEST_BITS {
            return points.iter().map(|i| (*i, level)).collect();
        }
        self.occupied.resize(N_WORDS, 0);
        let mut placed = Vec::new();
        let mut below: [Vec<u32>; 8] = Default::default();
        for &i in points {
            let position = inside[i as usize];
            // Bits of a voxel that lie below the side of the node.
            let voxel = |axis: usize| (position[axis] >> (bits - VOXEL_BITS) & ((1 << VOXEL_BITS) - 1)) as usize;
            let voxel = voxel(0) | voxel(1) << VOXEL_BITS | voxel(2) << (2 * VOXEL_BITS);
            let word = voxel / 64;
            let bit = 1 << (voxel % 64);
            if self.occupied[word] & bit == 0 {
                self.occupied[word] |= bit;
                placed.push((i, level));
            } else {
                below[octant(position, bits - 1)].push(i);
            }
        }
        let levels = self
            .children
            .par_iter_mut()
            .zip(below)
            .filter(|(_, points)| !points.is_empty())
            .map(|(child, points)| child.get_or_insert_default().place(&points, inside, bits - 1, level + 1));
        let levels: Vec<Vec<(u32, u32)>> = levels.collect();
        placed.extend(levels.into_iter().flatten());
        placed
    }

    /// Frees the voxels of all nodes that do not contain a block. Blocks come in the order of the octree, so the other
    /// nodes get no more points.
    pub(super) fn forget_all_but(&mut self, octree: &Octree, block: [i16; 3]) {
        let corner = octree.corner(block);
        let mut node = self;
        for bit in (BLOCK_BITS..octree.side_bits).rev() {
            let kept = octant(corner, bit);
            for (number, child) in node.children.iter_mut().enumerate() {
                if number != kept {
                    *child = None;
                }
            }
            match &mut node.children[kept] {
                Some(child) => node = child,
                None => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(position: [i32; 3]) -> Vec<u8> {
        position.into_iter().flat_map(i32::to_le_bytes).collect()
    }

    #[test]
    fn root_is_a_power_of_two_of_blocks() {
        let blocks = [[-3_i16, 5, 0], [1, 5, 0]];
        let octree = Octree::from_blocks(&blocks);
        // Five blocks in x are rounded up to eight.
        assert_eq!(octree, Octree { low: [-3 << 16, 5 << 16, 0], side_bits: 19 });
        assert_eq!(Octree::from_blocks(&blocks[..1]).side_bits, 16);
        assert_eq!(block_of([-1, 65_536, 65_535]), [-1, 1, 0]);
    }

    #[test]
    fn points_of_one_voxel_go_down_to_different_nodes() {
        let octree = Octree { low: [-(1 << 16); 3], side_bits: 17 };
        let mut root = Node::default();
        // The deepest voxels of all these points are in one node; they are 8 cm apart.
        let records: Vec<u8> = (0..8).flat_map(|i| record([i * 80, 0, 0])).collect();
        let keys = octree.place(&mut root, &records, 12);
        let levels: Vec<u32> = keys.iter().map(|key| key.level).collect();
        // Voxels have 1024, 512, 256, 128, 64 and 32 mm; nodes of 2 m are at level 6.
        assert_eq!(levels[0], 0);
        assert_eq!(levels[1], 1);
        assert!(levels.iter().all(|level| *level <= 6) && levels[7] > 0, "{levels:?}");
        for (i, key) in keys.iter().enumerate() {
            let side_bits = 17 - key.level;
            let inside = [i as u32 * 80 + (1 << 16), 1 << 16, 1 << 16];
            assert_eq!(key.cell, inside.map(|value| value >> side_bits), "{key:?}");
        }
        assert_eq!(octree.place(&mut root, &records, 12)[0].level, 3, "the voxels stay occupied");
    }

    #[test]
    fn voxels_of_blocks_that_are_done_are_forgotten() {
        let octree = Octree { low: [0; 3], side_bits: 18 };
        let blocks = [[3, 0, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]];
        let order = octree.order(blocks.to_vec());
        assert_eq!(order, [[0, 0, 0], [0, 1, 0], [1, 1, 0], [3, 0, 0]]);
        let mut root = Node::default();
        let records: Vec<u8> = (0..100).flat_map(|i| record([i, 0, 0])).collect();
        octree.place(&mut root, &records, 12);
        root.forget_all_but(&octree, [0, 1, 0]);
        let child = root.children[0].as_ref().expect("is around the block");
        assert!(child.children.iter().all(Option::is_none));
        root.forget_all_but(&octree, [3, 0, 0]);
        assert!(root.children.iter().all(Option::is_none));
        assert!(!root.occupied.is_empty());
    }

    #[test]
    fn ancestors_begin_with_the_root() {
        let key = NodeKey { level: 2, cell: [3, 1, 0] };
        let cells: Vec<[u32; 3]> = key.path_from_root().map(|key| key.cell).collect();
        assert_eq!(cells, [[0, 0, 0], [1, 0, 0], [3, 1, 0]]);
    }
}
