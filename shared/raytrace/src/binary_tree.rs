//! Binary bounding volume hierarchy, split by the binned surface area heuristic (Wald, "On fast construction of SAH-based bounding
//! volume hierarchies", 2007). Large subtrees are built in parallel. The tree is the same for any number of threads.

use crate::ray::Vec3;

/// Flat primitives per leaf: the number that one SIMD test covers ([`crate::flat`]).
pub const FLATS: usize = 4;
/// Bins per axis. Every plane between two bins is a split candidate.
const BINS: usize = 16;
/// From this depth on, nodes are split at the median, so that the depth is bounded for any input.
const SAH_DEPTH: usize = 40;
/// Subtrees with fewer items are built by the thread that split them.
const PARALLEL: usize = 8192;
/// Primitives that are not flat are tested one by one, each at about the cost of two SIMD tests.
const ROUND_COST: f32 = 2.0;

/// Bounding box of one primitive or object.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Smallest coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
    /// Index of the primitive or object, set by the caller.
    pub index: u32,
    /// Whether the item is flat: up to [`FLATS`] flat items share a leaf, any other item has its own.
    pub is_flat: bool,
}

impl Item {
    fn center(&self, axis: usize) -> f32 {
        0.5 * (self.low[axis] + self.high[axis])
    }
}

/// A node of the binary tree.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Smallest coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
    /// Items of a leaf; 0 = inner node.
    pub count: u32,
    /// First item of a leaf; the right child of an inner node, whose left child is the next node.
    pub next: u32,
}

impl Node {
    const NONE: Self = Self { low: Vec3::new(0.0, 0.0, 0.0), high: Vec3::new(0.0, 0.0, 0.0), count: 0, next: 0 };

    /// Half of the box's surface.
    pub fn half_area(&self) -> f32 {
        half_area(&(self.high - self.low))
    }
}

/// Builds the tree and sorts the items into the order of its leaves. The root is node 0. Without items there is no
/// node. Some nodes in the array are unused.
pub fn binary_tree(items: &mut [Item]) -> Vec<Node> {
    if items.is_empty() {
        return Vec::new();
    }
    let mut nodes = vec![Node::NONE; 2 * items.len() - 1];
    grow(&mut nodes, 0, items, 0, 0);
    nodes
}

/// Builds a subtree. `nodes` starts at number `at`, `items` at number `first`; a tree over n items has at most 2 n - 1
/// nodes.
fn grow(nodes: &mut [Node], at: usize, items: &mut [Item], first: usize, depth: usize) {
    let (low, high) = hull(items.iter().map(|item| (item.low, item.high)));
    nodes[0] = Node { low, high, count: items.len() as u32, next: first as u32 };
    let n_flat = items.iter().filter(|item| item.is_flat).count();
    if items.len() == 1 || (n_flat == items.len() && n_flat <= FLATS) {
        return;
    }
    let middle = if items.len() <= FLATS && n_flat > 0 {
        partition(items, |item| item.is_flat)
    } else {
        (if depth < SAH_DEPTH { sah_split(items) } else { None }).unwrap_or_else(|| halve(items))
    };
    nodes[0].count = 0;
    nodes[0].next = (at + 2 * middle) as u32;
    let (left_nodes, right_nodes) = nodes[1..].split_at_mut(2 * middle - 1);
    let (left_items, right_items) = items.split_at_mut(middle);
    let left = |nodes, items| grow(nodes, at + 1, items, first, depth + 1);
    let right = |nodes, items| grow(nodes, at + 2 * middle, items, first + middle, depth + 1);
    if left_items.len().min(right_items.len()) > PARALLEL {
        rayon::join(|| left(left_nodes, left_items), || right(right_nodes, right_items));
    } else {
        left(left_nodes, left_items);
        right(right_nodes, right_items);
    }
}

#[derive(Clone, Copy)]
struct Bin {
    low: Vec3,
    high: Vec3,
    n_flat: u32,
    n_round: u32,
}

impl Bin {
    const EMPTY: Self = Self {
        low: Vec3::new(f32::INFINITY, f32::INFINITY, f32::INFINITY),
        high: Vec3::new(f32::NEG_INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY),
        n_flat: 0,
        n_round: 0,
    };

    fn with(self, other: &Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
            n_flat: self.n_flat + other.n_flat,
            n_round: self.n_round + other.n_round,
        }
    }

    fn is_empty(&self) -> bool {
        self.n_flat + self.n_round == 0
    }

    /// Cost of testing its contents, times the probability that a ray meets it.
    fn cost(&self) -> f32 {
        let packs = self.n_flat.div_ceil(FLATS as u32) as f32;
        half_area(&(self.high - self.low)) * (packs + ROUND_COST * self.n_round as f32)
    }
}

/// Partitions the items at the cheapest plane and returns the number on the left; `None` if all centers coincide.
fn sah_split(items: &mut [Item]) -> Option<usize> {
    let centers = |item: &Item| (item.low + item.high) * 0.5;
    let (low, high) = hull(items.iter().map(|item| (centers(item), centers(item))));
    let per_m = (high - low).map(|extent| if extent > 1e-6 { BINS as f32 / extent } else { 0.0 });
    let mut bins = [[Bin::EMPTY; BINS]; 3];
    for item in items.iter() {
        let (n_flat, n_round) = if item.is_flat { (1, 0) } else { (0, 1) };
        let own = Bin { low: item.low, high: item.high, n_flat, n_round };
        for axis in 0..3 {
            let bin = &mut bins[axis][bin_of(item.center(axis), low[axis], per_m[axis])];
            *bin = bin.with(&own);
        }
    }
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| per_m[axis] > 0.0) {
        let mut right_costs = [None; BINS];
        let mut right = Bin::EMPTY;
        for cut in (1..BINS).rev() {
            right = right.with(&bins[axis][cut]);
            right_costs[cut] = (!right.is_empty()).then(|| right.cost());
        }
        let mut left = Bin::EMPTY;
        for cut in 1..BINS {
            left = left.with(&bins[axis][cut - 1]);
            let Some(right_cost) = right_costs[cut] else { break };
            if left.is_empty() {
                continue;
            }
            let cost = left.cost() + right_cost;
            if best.is_none_or(|(least, _, _)| cost < least) {
                best = Some((cost, axis, cut));
            }
        }
    }
    let (_, axis, cut) = best?;
    Some(partition(items, |item| bin_of(item.center(axis), low[axis], per_m[axis]) < cut))
}

fn bin_of(center: f32, low: f32, per_m: f32) -> usize {
    (((center - low) * per_m) as usize).min(BINS - 1)
}

/// Moves the left items to the front and returns their number.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..items.len() {
        if is_left(&items[i]) {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

fn halve(items: &mut [Item]) -> usize {
    let (low, high) = hull(items.iter().map(|item| (item.low, item.high)));
    let axis = (high - low).imax();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.center(axis).total_cmp(&b.center(axis)));
    middle
}

fn half_area(size: &Vec3) -> f32 {
    size.x * size.y + size.y * size.z + size.z * size.x
}

fn hull(boxes: impl Iterator<Item = (Vec3, Vec3)>) -> (Vec3, Vec3) {
    let none = (Vec3::repeat(f32::INFINITY), Vec3::repeat(f32::NEG_INFINITY));
    boxes.fold(none, |(low, high), (a, b)| (low.inf(&a), high.sup(&b)))
}
