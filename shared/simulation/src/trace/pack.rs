//! Four flat pieces, tested by a ray at once.

use super::build::FLATS;
use super::{MIN_RANGE_M, Ray, Shape, Vec3};
use std::ops::Sub;
use wide::f32x4;

/// A triangle or a parallelogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// One corner.
    pub corner: Vec3,
    /// From it to the second corner.
    pub edge1: Vec3,
    /// From it to the last corner.
    pub edge2: Vec3,
    /// The piece is where the shares u and v of the edges are 0 to 1 and u + v is at most this: 1 for a triangle, 2 for a parallelogram.
    pub reach: f32,
}

impl Flat {
    /// The piece, if the shape is one.
    pub fn of(shape: &Shape) -> Option<Self> {
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
        Pack::new(0, std::iter::once(*self)).nearest(ray, limit).map(|(_, range)| range)
    }
}

/// Rays may hit this far beside an edge, as a share of it: no ray falls through between two pieces that share an edge,
/// whatever f32 makes of it. 10 µm on a piece of 10 m.
pub const EDGE: f32 = 1e-6;

/// Up to four pieces by coordinate and lane; a lane without piece has edges of zero length, which no ray hits.
#[derive(Clone, Debug)]
pub struct Pack {
    corner: Four,
    edge1: Four,
    edge2: Four,
    reach: f32x4,
    /// Place of the first lane's piece in the order of the leaves.
    pub first: u32,
}

impl Pack {
    /// Up to four pieces.
    pub fn new(first: u32, pieces: impl Iterator<Item = Flat>) -> Self {
        let pieces: Vec<Flat> = pieces.take(FLATS).collect();
        let reach = std::array::from_fn(|lane| pieces.get(lane).map_or(0.0, |piece| piece.reach));
        let four = |part: fn(&Flat) -> Vec3| Four::gather(|lane| pieces.get(lane).map(part));
        Self {
            corner: four(|piece| piece.corner),
            edge1: four(|piece| piece.edge1),
            edge2: four(|piece| piece.edge2),
            reach: f32x4::new(reach),
            first,
        }
    }

    /// Lane and range of the first hit before the limit (Moeller and Trumbore, "Fast, minimum storage ray/triangle
    /// intersection", 1997).
    #[inline(always)]
    pub fn nearest(&self, ray: &Ray, limit: f32) -> Option<(usize, f32)> {
        let (origin, direction) = (Four::splat(&ray.origin), Four::splat(&ray.direction));
        let p = direction.cross(&self.edge2);
        let determinant = self.edge1.dot(&p);
        let inverse = f32x4::ONE / determinant;
        let from_corner = origin - self.corner;
        let u = from_corner.dot(&p) * inverse;
        let q = from_corner.cross(&self.edge1);
        let v = direction.dot(&q) * inverse;
        let range = self.edge2.dot(&q) * inverse;
        let (low, high) = (f32x4::splat(-EDGE), f32x4::splat(1.0 + EDGE));
        // A ray along the plane divides by zero; NaN fails every comparison but the first.
        let hits = determinant.simd_ne(f32x4::ZERO)
            & u.simd_ge(low)
            & v.simd_ge(low)
            & u.simd_le(high)
            & v.simd_le(high)
            & (u + v).simd_le(self.reach + f32x4::splat(EDGE))
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

/// Four vectors.
#[derive(Clone, Copy, Debug)]
struct Four {
    x: f32x4,
    y: f32x4,
    z: f32x4,
}

impl Four {
    fn splat(v: &Vec3) -> Self {
        Self { x: f32x4::splat(v.x), y: f32x4::splat(v.y), z: f32x4::splat(v.z) }
    }

    /// Of the lanes; zero where there is none.
    fn gather(lane: impl Fn(usize) -> Option<Vec3>) -> Self {
        let lanes: [Vec3; FLATS] = std::array::from_fn(|i| lane(i).unwrap_or_default());
        Self { x: f32x4::new(lanes.map(|v| v.x)), y: f32x4::new(lanes.map(|v| v.y)), z: f32x4::new(lanes.map(|v| v.z)) }
    }

    #[inline(always)]
    fn dot(&self, other: &Self) -> f32x4 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    fn cross(&self, other: &Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }
}

impl Sub for Four {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}
