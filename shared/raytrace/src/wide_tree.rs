//! Hierarchy whose nodes have four children: a ray tests the four boxes in the lanes of one SIMD register (Dammertz
//! et al., "Shallow bounding volume hierarchies for fast SIMD ray tracing of incoherent rays", 2008).

use crate::binary_tree::{Item, Node, binary_tree};
use crate::ray::{Ray, Vec3};
use wide::f32x4;

/// Children of a node.
pub const LANES: usize = 4;
/// Stack size that suffices for nearly all trees. Clearing a stack of a kilobyte would take a tenth of a ray's time.
const SHALLOW: usize = 64;
/// Stack size that suffices for any tree: the binary tree has at most 40 levels plus 32 median splits, and each level
/// leaves 3 entries.
pub(crate) const DEEP: usize = 256;

/// Content of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaf {
    /// Up to four flat primitives, by index.
    Flats(u32),
    /// One other item, by its index in the order of the leaves.
    Single(u32),
}

impl Leaf {
    /// Decodes a child.
    #[inline(always)]
    pub(crate) fn decode(child: u32) -> Self {
        if child & KIND == FLATS { Self::Flats(child & !KIND) } else { Self::Single(child & !KIND) }
    }
}

/// The two upper bits of a child: inner node, flat primitives or single item.
pub(crate) const KIND: u32 = 0b11 << 30;
pub(crate) const INNER: u32 = 0;
const FLATS: u32 = 0b01 << 30;
const SINGLE: u32 = 0b10 << 30;

/// Tolerance for f32 rounding: a ray may leave a box earlier than it enters it by this factor.
pub(crate) const SLACK: f32 = 1.000_001;

/// Boxes of the children per side (low, high), axis and lane. An unused lane has a box that no ray meets.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(crate) struct WideNode {
    pub(crate) sides: [[f32x4; 3]; 2],
    pub(crate) children: [u32; LANES],
}

/// A tree of boxes.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    pub(crate) nodes: Vec<WideNode>,
    bounds: Option<[Vec3; 2]>,
    /// Stack size that suffices for any ray.
    stack: usize,
}

impl Tree {
    /// Builds the tree and sorts the items into the order of its leaves. Calls `pack` with the first item and the number of
    /// items of each leaf of flat primitives, in order.
    pub fn over(items: &mut [Item], mut pack: impl FnMut(usize, usize)) -> Self {
        let binary = binary_tree(items);
        let Some(root) = binary.first() else { return Self::default() };
        let mut tree = Self { nodes: Vec::new(), bounds: Some([root.low, root.high]), stack: 0 };
        let mut widen = Widen { binary: &binary, items, n_packs: 0, pack: &mut pack };
        widen.node(&mut tree, 0, 1);
        tree
    }

    /// Smallest and largest coordinates; `None` for an empty tree.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        self.bounds
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    /// Calls `test` for the leaves whose boxes the ray meets before the limit, near leaves first, until `test` returns true.
    /// `test` may lower the limit.
    #[inline]
    pub fn walk(&self, ray: &Ray, limit: f32, test: impl FnMut(Leaf, &mut f32) -> bool) {
        if self.stack <= SHALLOW {
            self.walk_with::<SHALLOW>(ray, limit, test);
        } else {
            self.walk_with::<DEEP>(ray, limit, test);
        }
    }

    #[inline]
    fn walk_with<const STACK: usize>(&self, ray: &Ray, mut limit: f32, mut test: impl FnMut(Leaf, &mut f32) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let slabs = Slabs::new(ray);
        let mut stack = [(0.0_f32, INNER); STACK];
        let mut depth = 0;
        let mut child = INNER;
        loop {
            match child & KIND {
                INNER => {
                    let node = &self.nodes[(child & !KIND) as usize];
                    let (enter, mut meets) = slabs.enter(node, limit);
                    if meets.is_power_of_two() {
                        child = node.children[meets.trailing_zeros() as usize % LANES];
                        continue;
                    }
                    let bottom = depth;
                    while meets != 0 {
                        let lane = meets.trailing_zeros() as usize % LANES;
                        meets &= meets - 1;
                        // The nearest child is on top of the stack.
                        let mut at = depth;
                        while at > bottom && stack[(at - 1) % STACK].0 < enter[lane] {
                            stack[at % STACK] = stack[(at - 1) % STACK];
                            at -= 1;
                        }
                        stack[at % STACK] = (enter[lane], node.children[lane]);
                        depth += 1;
                    }
                }
                _ => {
                    if test(Leaf::decode(child), &mut limit) {
                        return;
                    }
                }
            }
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                let (enter, next) = stack[depth % STACK];
                if enter < limit {
                    child = next;
                    break;
                }
            }
        }
    }
}

/// A ray, prepared for box tests.
struct Slabs {
    origin: [f32x4; 3],
    inverse: [f32x4; 3],
    /// Per axis: 0 if the ray enters a box through its low side.
    near: [usize; 3],
}

impl Slabs {
    #[inline]
    fn new(ray: &Ray) -> Self {
        let along = ray.along();
        Self {
            origin: <[f32; 3]>::from(ray.origin).map(f32x4::splat),
            inverse: <[f32; 3]>::from(along).map(|d| f32x4::splat(1.0 / d)),
            near: along.map(|d| usize::from(d < 0.0)).into(),
        }
    }

    /// Range at which the ray enters each box, and a bit for each box that it meets before the limit.
    #[inline(always)]
    fn enter(&self, node: &WideNode, limit: f32) -> ([f32; LANES], u32) {
        let mut enter = f32x4::ZERO;
        let mut leave = f32x4::splat(limit);
        for axis in 0..3 {
            let near = node.sides[self.near[axis]][axis];
            let far = node.sides[1 - self.near[axis]][axis];
            enter = ((near - self.origin[axis]) * self.inverse[axis]).fast_max(enter);
            leave = ((far - self.origin[axis]) * self.inverse[axis]).fast_min(leave);
        }
        let meets = enter.simd_le(leave * f32x4::splat(SLACK));
        (enter.to_array(), meets.to_bitmask())
    }
}

/// Collapses the binary tree into nodes with four children.
struct Widen<'a> {
    binary: &'a [Node],
    items: &'a [Item],
    n_packs: u32,
    pack: &'a mut dyn FnMut(usize, usize),
}

impl Widen<'_> {
    /// Appends the wide node of a binary node and its subtree. `stack` counts the entries in use when a ray reaches it,
    /// including the node.
    fn node(&mut self, tree: &mut Tree, binary: usize, stack: usize) -> u32 {
        let mut children = vec![binary];
        while children.len() < LANES {
            // The largest box is hit most often, so its children are promoted first.
            let inner = children.iter().enumerate().filter(|(_, child)| self.binary[**child].count == 0);
            let largest = inner
                .max_by(|a, b| self.binary[*a.1].half_area().total_cmp(&self.binary[*b.1].half_area()))
                .map(|(place, _)| place);
            let Some(place) = largest else { break };
            let opened = children[place];
            children[place] = opened + 1;
            children.insert(place + 1, self.binary[opened].next as usize);
        }
        let number = tree.nodes.len();
        tree.stack = tree.stack.max(stack - 1 + children.len());
        tree.nodes.push(WideNode { sides: [[f32x4::ZERO; 3]; 2], children: [INNER; LANES] });
        let mut sides = [[[f32::INFINITY; LANES]; 3], [[f32::NEG_INFINITY; LANES]; 3]];
        let mut codes = [INNER; LANES];
        for (lane, &child) in children.iter().enumerate() {
            let node = self.binary[child];
            let code =
                if node.count == 0 { self.node(tree, child, stack - 1 + children.len()) } else { self.leaf(&node) };
            codes[lane] = code;
            for (axis, (low, high)) in node.low.iter().zip(&node.high).enumerate() {
                sides[0][axis][lane] = *low;
                sides[1][axis][lane] = *high;
            }
        }
        tree.nodes[number] = WideNode { sides: sides.map(|side| side.map(f32x4::new)), children: codes };
        number as u32
    }

    fn leaf(&mut self, node: &Node) -> u32 {
        if !self.items[node.next as usize].is_flat {
            return SINGLE | node.next;
        }
        (self.pack)(node.next as usize, node.count as usize);
        self.n_packs += 1;
        FLATS | (self.n_packs - 1)
    }
}
