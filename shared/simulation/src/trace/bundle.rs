//! Rays side by side: neighbors go the same way through a tree, so a box or a flat piece is fetched once for all of them
//! and tested against sixteen at once, in the widest registers that the machine has (Wald et al., "Interactive rendering
//! with coherent ray tracing", 2001).

use super::Ray;
use super::pack::Pack;
use super::tree::{DEEP, INNER, KIND, Leaf, SLACK, Tree, Wide};

/// Rays of a bundle.
pub const RAYS: usize = 16;
/// One number for each ray.
pub type Lanes = [f32; RAYS];

/// Up to [`RAYS`] rays that go into the same octant, by coordinate and lane. A lane without ray repeats the first one.
#[derive(Clone, Debug)]
pub struct Bundle {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    inverse: [Lanes; 3],
    /// 0 where the rays enter a box by its low side.
    near: [usize; 3],
}

impl Bundle {
    /// Of the rays; `None` if there are none, or too many, or if they go into several octants.
    pub fn new(rays: &[Ray]) -> Option<Self> {
        if rays.is_empty() || rays.len() > RAYS {
            return None;
        }
        let octant = |ray: &Ray| <[usize; 3]>::from(ray.along().map(|d| usize::from(d < 0.0)));
        let near = octant(&rays[0]);
        if rays.iter().any(|ray| octant(ray) != near) {
            return None;
        }
        let mut bundle =
            Self { origin: [[0.0; RAYS]; 3], direction: [[0.0; RAYS]; 3], inverse: [[0.0; RAYS]; 3], near };
        for lane in 0..RAYS {
            let ray = rays.get(lane).unwrap_or(&rays[0]);
            let along = ray.along();
            for axis in 0..3 {
                bundle.origin[axis][lane] = ray.origin[axis];
                bundle.direction[axis][lane] = ray.direction[axis];
                bundle.inverse[axis][lane] = 1.0 / along[axis];
            }
        }
        Some(bundle)
    }

    /// Calls `test` for the leaves whose boxes some of the rays meet before their limits, near ones first. A bit is set for
    /// each of those rays. `test` may lower the limits. A ray with a limit below zero
    /// meets nothing.
    #[inline(always)]
    pub fn walk(&self, tree: &Tree, limits: &mut Lanes, mut test: impl FnMut(Leaf, u32, &mut Lanes)) {
        if tree.nodes.is_empty() {
            return;
        }
        let mut stack = [(0.0_f32, INNER, 0_u32); DEEP];
        let mut depth = 0;
        let mut child = INNER;
        let mut rays = 0_u32;
        loop {
            if child & KIND == INNER {
                let bottom = depth;
                let node = &tree.nodes[(child & !KIND) as usize];
                for lane in 0..node.children.len() {
                    let (enter, rays) = self.enter(node, lane, limits);
                    if rays == 0 {
                        continue;
                    }
                    // The nearest comes to lie on top.
                    let mut at = depth;
                    while at > bottom && stack[(at - 1) % DEEP].0 < enter {
                        stack[at % DEEP] = stack[(at - 1) % DEEP];
                        at -= 1;
                    }
                    stack[at % DEEP] = (enter, node.children[lane], rays);
                    depth += 1;
                }
            } else {
                test(Leaf::of(child), rays, limits);
            }
            let farthest = farthest(limits);
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                let (enter, next, some) = stack[depth % DEEP];
                if enter <= farthest {
                    (child, rays) = (next, some);
                    break;
                }
            }
        }
    }

    /// Least range at which rays enter a child's box, and a bit for each that meets it before its limit.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "over lanes of many arrays, for the compiler to do side by side")]
    fn enter(&self, node: &Wide, child: usize, limits: &Lanes) -> (f32, u32) {
        let near: [f32; 3] = std::array::from_fn(|axis| node.sides[self.near[axis]][axis].as_array()[child]);
        let far: [f32; 3] = std::array::from_fn(|axis| node.sides[1 - self.near[axis]][axis].as_array()[child]);
        let (mut least, mut rays) = (u32::MAX, 0);
        for lane in 0..RAYS {
            let (mut enter, mut leave) = (0.0, f32::INFINITY);
            for axis in 0..3 {
                enter = larger((near[axis] - self.origin[axis][lane]) * self.inverse[axis][lane], enter);
                leave = smaller((far[axis] - self.origin[axis][lane]) * self.inverse[axis][lane], leave);
            }
            let meets = enter <= smaller(leave * SLACK, limits[lane]);
            // Ranges are not negative: their bits are in the same order.
            least = least.min(if meets { enter.to_bits() } else { u32::MAX });
            rays |= if meets { 1 << lane } else { 0 };
        }
        (f32::from_bits(least), rays)
    }

    /// What the rays hit of the pack's pieces.
    #[inline(always)]
    pub fn hit_flats(&self, pack: &Pack, found: &mut Found) {
        for number in 0..pack.n_pieces {
            let (piece, place) = (pack.piece(number as usize), pack.first + number);
            for lane in 0..RAYS {
                let origin = std::array::from_fn(|axis| self.origin[axis][lane]);
                let direction = std::array::from_fn(|axis| self.direction[axis][lane]);
                let (range, is_hit) = piece.hit(origin, direction);
                found.add(lane, if is_hit { range } else { f32::INFINITY }, place);
            }
        }
    }
}

/// What the rays of a bundle have found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Range of the nearest hit; the longest range of interest where there is none.
    pub ranges: Lanes,
    /// Range of the second.
    seconds: Lanes,
    /// Its place in the order of the leaves; [`NOWHERE`] = none.
    pub places: [u32; RAYS],
}

/// The place of no primitive.
pub const NOWHERE: u32 = u32::MAX;
/// Hits are in doubt if a second one is not this much farther.
const CLOSE: f32 = 1.000_01;

impl Found {
    /// Nothing yet before `max_m`.
    pub const fn nothing(max_m: f32) -> Self {
        Self { ranges: [max_m; RAYS], seconds: [f32::INFINITY; RAYS], places: [NOWHERE; RAYS] }
    }

    /// A ray hits something.
    #[inline(always)]
    pub fn add(&mut self, lane: usize, range: f32, place: u32) {
        let first = self.ranges[lane];
        self.seconds[lane] = smaller(self.seconds[lane], larger(first, range));
        self.ranges[lane] = smaller(first, range);
        self.places[lane] = if range < first { place } else { self.places[lane] };
    }

    /// Where a ray need not look farther.
    #[inline(always)]
    pub fn limit(&self, lane: usize) -> f32 {
        self.ranges[lane] * CLOSE
    }

    /// Whether two hits are so close that rounding or the order of looking may decide between them.
    pub fn is_in_doubt(&self, lane: usize) -> bool {
        self.places[lane] != NOWHERE && self.seconds[lane] <= self.limit(lane)
    }
}

/// The largest limit; negative if all are.
#[inline(always)]
fn farthest(limits: &Lanes) -> f32 {
    // Read as integers the positive ones keep their order, above all negative ones.
    let mut most = i32::MIN;
    for limit in limits {
        most = most.max(limit.to_bits() as i32);
    }
    f32::from_bits(most as u32)
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
