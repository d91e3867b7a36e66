//! A tree of boxes over primitives (bounding volume hierarchy), split by the surface area heuristic in bins (Wald, "On
//! fast construction of SAH-based bounding volume hierarchies", 2007).

use super::{Primitive, Ray, Vec3};

const BINS: usize = 16;
/// A box test costs about as much as a triangle test; four primitives fill a cache line pair.
const LEAF: usize = 4;
/// The tree is split by halves from here on, so that the stack of a traversal is bounded for any input.
const SAH_DEPTH: usize = 32;
/// [`SAH_DEPTH`] and the halvings of 2^32 primitives.
const STACK: usize = 64;

/// The tree. Primitives lie in the order of its leaves.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    primitives: Vec<Primitive>,
}

/// Inner node: `count` 0, children at `first` and `first + 1`. Leaf: primitives `first..first + count`.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    first: u32,
    high: Vec3,
    count: u32,
}

struct Item {
    low: Vec3,
    high: Vec3,
    center: Vec3,
    primitive: Primitive,
}

impl Bvh {
    /// The tree over the primitives.
    pub fn new(primitives: Vec<Primitive>) -> Self {
        let mut items: Vec<Item> = primitives
            .into_iter()
            .map(|primitive| {
                let [low, high] = primitive.shape.bounds();
                Item { low, high, center: (low + high) * 0.5, primitive }
            })
            .collect();
        let mut nodes = Vec::with_capacity(items.len() / 2 + 1);
        if !items.is_empty() {
            nodes.push(leaf(&items, 0));
            split(&mut nodes, 0, &mut items, 0, 0);
        }
        Self { nodes, primitives: items.into_iter().map(|item| item.primitive).collect() }
    }

    /// Number of primitives.
    pub const fn len(&self) -> usize {
        self.primitives.len()
    }

    /// Whether there is nothing to hit.
    pub const fn is_empty(&self) -> bool {
        self.primitives.is_empty()
    }

    /// Smallest and largest coordinates; `None` of an empty tree.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        self.nodes.first().map(|root| [root.low, root.high])
    }

    /// The first hit before `max_m`: its range and the primitive.
    pub fn nearest(&self, ray: &Ray, max_m: f32) -> Option<(f32, &Primitive)> {
        let mut best = None;
        let mut limit = max_m;
        self.visit(ray, &mut limit, |primitive, limit| {
            if let Some(range) = primitive.shape.range(ray, *limit) {
                *limit = range;
                best = Some((range, primitive));
            }
            false
        });
        best
    }

    /// Whether anything lies before `max_m`.
    pub fn any(&self, ray: &Ray, max_m: f32) -> bool {
        let mut hit = false;
        let mut limit = max_m;
        self.visit(ray, &mut limit, |primitive, limit| {
            hit = primitive.shape.range(ray, *limit).is_some();
            hit
        });
        hit
    }

    /// Calls `test` for the primitives of boxes that the ray meets before the limit, near boxes first, until it says stop.
    #[inline]
    fn visit<'a>(&'a self, ray: &Ray, limit: &mut f32, mut test: impl FnMut(&'a Primitive, &mut f32) -> bool) {
        let inverse = ray.direction.map(|d| 1.0 / d);
        let Some(root) = self.nodes.first() else { return };
        if entry(root, ray, &inverse, *limit).is_none() {
            return;
        }
        let mut stack = [(0_u32, 0.0_f32); STACK];
        let mut depth = 0;
        let mut at = 0_u32;
        loop {
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                for primitive in &self.primitives[node.first as usize..(node.first + node.count) as usize] {
                    if test(primitive, limit) {
                        return;
                    }
                }
            } else {
                let (left, right) = (node.first, node.first + 1);
                let enter_left = entry(&self.nodes[left as usize], ray, &inverse, *limit);
                let enter_right = entry(&self.nodes[right as usize], ray, &inverse, *limit);
                match (enter_left, enter_right) {
                    (Some(l), Some(r)) => {
                        let (near, far) = if l <= r { (left, (right, r)) } else { (right, (left, l)) };
                        stack[depth] = far;
                        depth += 1;
                        at = near;
                        continue;
                    }
                    (Some(_), None) => {
                        at = left;
                        continue;
                    }
                    (None, Some(_)) => {
                        at = right;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                if stack[depth].1 < *limit {
                    at = stack[depth].0;
                    break;
                }
            }
        }
    }
}

/// Range at which the ray enters the box, if it does so before the limit.
#[inline]
fn entry(node: &Node, ray: &Ray, inverse: &Vec3, limit: f32) -> Option<f32> {
    let to_low = (node.low - ray.origin).component_mul(inverse);
    let to_high = (node.high - ray.origin).component_mul(inverse);
    let enter = to_low.x.min(to_high.x).max(to_low.y.min(to_high.y)).max(to_low.z.min(to_high.z)).max(0.0);
    let leave = to_low.x.max(to_high.x).min(to_low.y.max(to_high.y)).min(to_low.z.max(to_high.z));
    // f32 may lose the last two bits on the way.
    (enter <= leave * 1.000_001 && enter < limit).then_some(enter)
}

fn leaf(items: &[Item], first: usize) -> Node {
    let (low, high) = hull(items.iter().map(|item| (item.low, item.high)));
    Node { low, high, first: first as u32, count: items.len() as u32 }
}

fn hull(boxes: impl Iterator<Item = (Vec3, Vec3)>) -> (Vec3, Vec3) {
    let none = (Vec3::repeat(f32::INFINITY), Vec3::repeat(f32::NEG_INFINITY));
    boxes.fold(none, |(low, high), (a, b)| (low.inf(&a), high.sup(&b)))
}

fn split(nodes: &mut Vec<Node>, node: usize, items: &mut [Item], first: usize, depth: usize) {
    if items.len() <= LEAF {
        return;
    }
    let middle = if depth < SAH_DEPTH { sah_split(items) } else { None }.unwrap_or_else(|| halve(items));
    let left = nodes.len();
    nodes[node].first = left as u32;
    nodes[node].count = 0;
    let (before, after) = items.split_at_mut(middle);
    nodes.push(leaf(before, first));
    nodes.push(leaf(after, first + middle));
    split(nodes, left, before, first, depth + 1);
    split(nodes, left + 1, after, first + middle, depth + 1);
}

/// Sorts the items around the cheapest plane between bins; `None` if all centers coincide.
fn sah_split(items: &mut [Item]) -> Option<usize> {
    let (low, high) = hull(items.iter().map(|item| (item.center, item.center)));
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        let extent = high[axis] - low[axis];
        if extent <= 1e-6 {
            continue;
        }
        let mut bins: Vec<(usize, Vec3, Vec3)> =
            vec![(0, Vec3::repeat(f32::INFINITY), Vec3::repeat(f32::NEG_INFINITY)); BINS];
        for item in items.iter() {
            let bin = &mut bins[bin_of(item.center[axis], low[axis], extent)];
            *bin = (bin.0 + 1, bin.1.inf(&item.low), bin.2.sup(&item.high));
        }
        for cut in 1..BINS {
            let side = |part: &[(usize, Vec3, Vec3)]| {
                let count: usize = part.iter().map(|bin| bin.0).sum();
                let (a, b) = hull(part.iter().map(|bin| (bin.1, bin.2)));
                (count, half_area(&(b - a)))
            };
            let ((n_left, area_left), (n_right, area_right)) = (side(&bins[..cut]), side(&bins[cut..]));
            if n_left == 0 || n_right == 0 {
                continue;
            }
            let cost = n_left as f32 * area_left + n_right as f32 * area_right;
            if best.is_none_or(|(least, _, _)| cost < least) {
                best = Some((cost, axis, cut));
            }
        }
    }
    let (_, axis, cut) = best?;
    let extent = high[axis] - low[axis];
    items.sort_by_key(|item| bin_of(item.center[axis], low[axis], extent) >= cut);
    Some(items.partition_point(|item| bin_of(item.center[axis], low[axis], extent) < cut))
}

fn bin_of(value: f32, low: f32, extent: f32) -> usize {
    (((value - low) / extent * BINS as f32) as usize).min(BINS - 1)
}

fn half_area(size: &Vec3) -> f32 {
    size.x * size.y + size.y * size.z + size.z * size.x
}

fn halve(items: &mut [Item]) -> usize {
    let (low, high) = hull(items.iter().map(|item| (item.center, item.center)));
    let axis = (high - low).imax();
    items.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
    items.len() / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::trace::Shape;

    fn random_scene(n: u32) -> Vec<Primitive> {
        let mut random = Random::new(5, 0);
        let point = |random: &mut Random, size: f32| {
            Vec3::new(random.range(-size, size), random.range(-size, size), random.range(-size, size))
        };
        (0..n)
            .map(|surface| {
                let center = point(&mut random, 30.0);
                let shape = match surface % 3 {
                    0 => Shape::triangle(center, center + point(&mut random, 3.0), center + point(&mut random, 3.0)),
                    1 => Shape::cylinder(center, center + point(&mut random, 3.0), 0.4),
                    _ => Shape::Sphere { center, radius: 0.8 },
                };
                Primitive { shape, surface }
            })
            .collect()
    }

    #[test]
    fn the_tree_finds_what_trying_all_finds() {
        let all = random_scene(900);
        let tree = Bvh::new(all.clone());
        let mut random = Random::new(6, 0);
        let mut hits = 0;
        for _ in 0..3000 {
            let origin = Vec3::new(random.range(-40.0, 40.0), random.range(-40.0, 40.0), random.range(-40.0, 40.0));
            let direction =
                (-origin + Vec3::new(random.range(-20.0, 20.0), random.range(-20.0, 20.0), 0.0)).normalize();
            let ray = Ray { origin, direction, seed: 0 };
            let expected = all
                .iter()
                .filter_map(|p| p.shape.range(&ray, 100.0).map(|range| (range, p.surface)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let found = tree.nearest(&ray, 100.0).map(|(range, p)| (range, p.surface));
            assert_eq!(found, expected);
            assert_eq!(tree.any(&ray, 100.0), expected.is_some());
            hits += usize::from(expected.is_some());
        }
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn rays_along_an_axis_and_equal_centers_are_no_trouble() {
        let same =
            vec![Primitive { shape: Shape::Sphere { center: Vec3::new(3.0, 0.0, 0.0), radius: 1.0 }, surface: 1 }; 300];
        let tree = Bvh::new(same);
        let ray = Ray { origin: Vec3::zeros(), direction: Vec3::x(), seed: 0 };
        let (range, _) = tree.nearest(&ray, 10.0).expect("hit");
        assert!((range - 2.0).abs() < 1e-5);
        assert!(Bvh::new(Vec::new()).nearest(&ray, 10.0).is_none());
    }
}
