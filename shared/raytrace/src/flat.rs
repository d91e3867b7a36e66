//! Flat primitives, tested by a ray four at a time.

use crate::binary_tree::FLATS;
use crate::ray::{MIN_RANGE_M, Ray, Vec3};
use crate::shape::Shape;
use std::ops::{Add, Div, Mul, Sub};
use wide::f32x4;

/// A triangle or a parallelogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// One corner.
    pub corner: Vec3,
    /// Edge from the corner to the second corner.
    pub edge1: Vec3,
    /// Edge from the corner to the last corner.
    pub edge2: Vec3,
    /// Largest u + v inside, where u and v are the barycentric shares of the edges: 1 for a triangle, 2 for a parallelogram.
    pub reach: f32,
}

impl Flat {
    /// The flat primitive of a shape; `None` if the shape is not flat.
    pub fn from_shape(shape: &Shape) -> Option<Self> {
        match *shape {
            Shape::Triangle { corner, edge1, edge2 } => Some(Self { corner, edge1, edge2, reach: 1.0 }),
            Shape::Panel { corner, edge1, edge2, fill } if fill >= 1.0 => {
                Some(Self { corner, edge1, edge2, reach: 2.0 })
            }
            _ => None,
        }
    }

    /// Range of the hit before the limit.
    pub fn range(&self, ray: &Ray, limit: f32) -> Option<f32> {
        Flat4::new(0, std::iter::once(*self)).nearest(ray, limit).map(|(_, range)| range)
    }
}

/// Tolerance at edges, as a share of the edge: despite rounding, no ray passes between two primitives that share an
/// edge. 10 µm on an edge of 10 m.
pub const EDGE: f32 = 1e-6;

/// Up to four flat primitives, per coordinate and lane. An unused lane has edges of zero length, which no ray hits.
#[derive(Clone, Debug)]
pub struct Flat4 {
    lanes: Pieces<f32x4>,
    /// Index of the first lane's primitive in the order of the leaves.
    pub first: u32,
    /// Used lanes.
    pub n_pieces: u32,
}

impl Flat4 {
    /// Packs up to four flat primitives.
    pub fn new(first: u32, pieces: impl Iterator<Item = Flat>) -> Self {
        let pieces: Vec<Flat> = pieces.take(FLATS).collect();
        let lanes =
            |part: &dyn Fn(&Flat) -> f32| f32x4::new(std::array::from_fn(|lane| pieces.get(lane).map_or(0.0, part)));
        let four = |part: fn(&Flat) -> Vec3| std::array::from_fn(|axis| lanes(&|piece| part(piece)[axis]));
        let lanes = Pieces {
            corner: four(|piece| piece.corner),
            edge1: four(|piece| piece.edge1),
            edge2: four(|piece| piece.edge2),
            reach: lanes(&|piece| piece.reach),
        };
        Self { lanes, first, n_pieces: pieces.len() as u32 }
    }

    /// The primitive of one lane.
    #[inline(always)]
    pub fn piece(&self, lane: usize) -> Pieces<f32> {
        let Pieces { corner, edge1, edge2, reach } = &self.lanes;
        let one = |four: &[f32x4; 3]| [0, 1, 2].map(|axis| four[axis].as_array()[lane % FLATS]);
        Pieces { corner: one(corner), edge1: one(edge1), edge2: one(edge2), reach: reach.as_array()[lane % FLATS] }
    }

    /// Lane and range of the first hit before the limit.
    #[inline(always)]
    pub fn nearest(&self, ray: &Ray, limit: f32) -> Option<(usize, f32)> {
        let Meeting { determinant, u, v, range } =
            self.lanes.meet([0, 1, 2].map(|axis| f32x4::splat(ray.origin[axis])), {
                [0, 1, 2].map(|axis| f32x4::splat(ray.direction[axis]))
            });
        let low = f32x4::splat(-EDGE);
        let high = f32x4::splat(1.0 + EDGE);
        // A ray along the plane divides by zero; NaN fails every comparison but the first.
        let hits = determinant.simd_ne(f32x4::ZERO)
            & u.simd_ge(low)
            & v.simd_ge(low)
            & u.simd_le(high)
            & v.simd_le(high)
            & (u + v).simd_le(self.lanes.reach + f32x4::splat(EDGE))
            & range.simd_gt(f32x4::splat(MIN_RANGE_M))
            & range.simd_lt(f32x4::splat(limit));
        let mut hits = hits.to_bitmask();
        if hits == 0 {
            return None;
        }
        let ranges = range.to_array();
        let mut best = hits.trailing_zeros() as usize % FLATS;
        hits &= hits - 1;
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize % FLATS;
            hits &= hits - 1;
            if ranges[lane] < ranges[best] {
                best = lane;
            }
        }
        Some((best, ranges[best]))
    }
}

/// Flat primitives per coordinate, one in each lane of `T`.
#[derive(Clone, Copy, Debug)]
pub struct Pieces<T> {
    corner: [T; 3],
    edge1: [T; 3],
    edge2: [T; 3],
    reach: T,
}

/// Intersection of rays with the planes of flat primitives.
struct Meeting<T> {
    determinant: T,
    /// Barycentric shares of the edges.
    u: T,
    v: T,
    range: T,
}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T> + Div<Output = T> + From<f32>> Pieces<T> {
    /// Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997. Results
    /// for single rays and for packets are equal to the last bit.
    #[inline(always)]
    fn meet(&self, origin: [T; 3], direction: [T; 3]) -> Meeting<T> {
        let p = cross(direction, self.edge2);
        let determinant = dot(self.edge1, p);
        let inverse = T::from(1.0) / determinant;
        let from_corner = [0, 1, 2].map(|axis| origin[axis] - self.corner[axis]);
        let u = dot(from_corner, p) * inverse;
        let q = cross(from_corner, self.edge1);
        let v = dot(direction, q) * inverse;
        Meeting { determinant, u, v, range: dot(self.edge2, q) * inverse }
    }
}

impl Pieces<f32> {
    /// Range at which a ray meets the plane, and whether it is a hit.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "vectorized lanes cannot branch")]
    pub fn hit(&self, origin: [f32; 3], direction: [f32; 3]) -> (f32, bool) {
        let Meeting { determinant, u, v, range } = self.meet(origin, direction);
        let low = -EDGE;
        let high = 1.0 + EDGE;
        let is_inside = (u >= low) & (v >= low) & (u <= high) & (v <= high) & (u + v <= self.reach + EDGE);
        (range, (determinant != 0.0) & is_inside & (range > MIN_RANGE_M))
    }
}

#[inline(always)]
fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
