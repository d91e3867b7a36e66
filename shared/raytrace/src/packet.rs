//! Packets of rays. Coherent rays visit the same nodes, so a box or a flat primitive is fetched once for all sixteen rays and
//! tested against them in the widest SIMD registers of the machine (Wald et al., "Interactive rendering
//! with coherent ray tracing", 2001).

use crate::flat::Flat4;
use crate::ray::Ray;
use crate::wide_tree::{DEEP, INNER, KIND, Leaf, SLACK, Tree, WideNode};

/// Number of rays of a packet.
pub const PACKET_SIZE: usize = 16;
/// One number per ray.
pub type Lanes = [f32; PACKET_SIZE];

/// Up to [`PACKET_SIZE`] rays with directions in the same octant, per coordinate and lane. A lane without a ray repeats
/// the first one.
#[derive(Clone, Debug)]
pub struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    inverse: [Lanes; 3],
    /// Per axis: 0 if the rays enter a box through its low side.
    near: [usize; 3],
}

impl Packet {
    /// Creates a packet; `None` if there are no rays or too many, or if their directions are in several octants.
    pub fn new(rays: &[Ray]) -> Option<Self> {
        if rays.is_empty() || rays.len() > PACKET_SIZE {
            return None;
        }
        let octant = |ray: &Ray| <[usize; 3]>::from(ray.along().map(|d| usize::from(d < 0.0)));
        let near = octant(&rays[0]);
        if rays.iter().any(|ray| octant(ray) != near) {
            return None;
        }
        let mut bundle = Self {
            origin: [[0.0; PACKET_SIZE]; 3],
            direction: [[0.0; PACKET_SIZE]; 3],
            inverse: [[0.0; PACKET_SIZE]; 3],
            near,
        };
        for lane in 0..PACKET_SIZE {
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

    /// Calls `test` for the leaves whose boxes rays meet before their limits, near leaves first, with a bit set for each such
    /// ray. `test` may lower the limits. A ray with a negative limit meets nothing.
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
                    // The nearest child is on top of the stack.
                    let mut at = depth;
                    while at > bottom && stack[(at - 1) % DEEP].0 < enter {
                        stack[at % DEEP] = stack[(at - 1) % DEEP];
                        at -= 1;
                    }
                    stack[at % DEEP] = (enter, node.children[lane], rays);
                    depth += 1;
                }
            } else {
                test(Leaf::decode(child), rays, limits);
            }
            let farthest = farthest(limits);
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                let (enter, next, some) = stack[depth % DEEP];
                if enter <= farthest {
                    child = next;
                    rays = some;
                    break;
                }
            }
        }
    }

    /// Least range at which rays enter a child's box, and a bit for each ray that meets it before its limit.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "the compiler vectorizes the loop over lanes of several arrays")]
    fn enter(&self, node: &WideNode, child: usize, limits: &Lanes) -> (f32, u32) {
        let near: [f32; 3] = std::array::from_fn(|axis| node.sides[self.near[axis]][axis].as_array()[child]);
        let far: [f32; 3] = std::array::from_fn(|axis| node.sides[1 - self.near[axis]][axis].as_array()[child]);
        let mut least = u32::MAX;
        let mut rays = 0;
        for lane in 0..PACKET_SIZE {
            let mut enter = 0.0;
            let mut leave = f32::INFINITY;
            for axis in 0..3 {
                enter = larger((near[axis] - self.origin[axis][lane]) * self.inverse[axis][lane], enter);
                leave = smaller((far[axis] - self.origin[axis][lane]) * self.inverse[axis][lane], leave);
            }
            let meets = enter <= smaller(leave * SLACK, limits[lane]);
            // Ranges are not negative, so their bits have the same order.
            least = least.min(if meets { enter.to_bits() } else { u32::MAX });
            rays |= if meets { 1 << lane } else { 0 };
        }
        (f32::from_bits(least), rays)
    }

    /// Tests all rays against the flat primitives of a leaf.
    #[inline(always)]
    pub fn hit_flats(&self, pack: &Flat4, found: &mut Found) {
        for number in 0..pack.n_pieces {
            let piece = pack.piece(number as usize);
            let place = pack.first + number;
            for lane in 0..PACKET_SIZE {
                let origin = std::array::from_fn(|axis| self.origin[axis][lane]);
                let direction = std::array::from_fn(|axis| self.direction[axis][lane]);
                let (range, is_hit) = piece.hit(origin, direction);
                found.add(lane, if is_hit { range } else { f32::INFINITY }, place);
            }
        }
    }
}

/// Nearest hits of the rays of a packet so far.
#[derive(Clone, Debug)]
pub struct Found {
    /// Range of the nearest hit; the maximum range without a hit.
    pub ranges: Lanes,
    /// Range of the second nearest hit.
    seconds: Lanes,
    /// Primitive of the nearest hit, in the order of the leaves; [`NOWHERE`] without a hit.
    pub places: [u32; PACKET_SIZE],
}

/// Index that means no primitive.
pub const NOWHERE: u32 = u32::MAX;
/// A hit is ambiguous if the range of the second one is within this factor.
const CLOSE: f32 = 1.000_01;

impl Found {
    /// Creates the state without hits, up to `max_m`.
    pub const fn nothing(max_m: f32) -> Self {
        Self { ranges: [max_m; PACKET_SIZE], seconds: [f32::INFINITY; PACKET_SIZE], places: [NOWHERE; PACKET_SIZE] }
    }

    /// Adds a hit of a ray.
    #[inline(always)]
    pub fn add(&mut self, lane: usize, range: f32, place: u32) {
        let first = self.ranges[lane];
        self.seconds[lane] = smaller(self.seconds[lane], larger(first, range));
        self.ranges[lane] = smaller(first, range);
        self.places[lane] = if range < first { place } else { self.places[lane] };
    }

    /// Range beyond which hits of a ray do not matter.
    #[inline(always)]
    pub fn limit(&self, lane: usize) -> f32 {
        self.ranges[lane] * CLOSE
    }

    /// Whether two hits are so close that rounding or the order of tests may decide between them.
    pub fn is_ambiguous(&self, lane: usize) -> bool {
        self.places[lane] != NOWHERE && self.seconds[lane] <= self.limit(lane)
    }
}

/// The largest limit; negative if all limits are.
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
