//! The map points within a cube of one metre, laid out for SIMD registers.

use crate::{Kernel, Weights};

/// Points per block: one register of 64 bytes, or two of 32.
const LANES: usize = 16;
/// Cosine of the largest angle between normals of one surface, 37 degrees.
pub(crate) const SAME_SURFACE: f32 = 0.8;
/// Coordinate of unused lanes, m: outside of every search radius.
const UNUSED: f32 = 1e6;

/// A point of a surface, relative to its cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellPoint {
    /// Position relative to the cell's lower corner, m.
    pub position: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Levers of the ring's elevation and of the revolution, see [`crate::MapPoint`].
    pub levers: [f32; 2],
}

/// Lanes per coordinate: x y z, then the normal, then the levers.
type Block = [[f32; LANES]; 8];

/// Points in insertion order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cell {
    n: usize,
    blocks: Vec<Block>,
}

/// Sums over the points around a position, per lane: weights, weighted distances from their planes, weighted normals,
/// weighted levers.
#[derive(Clone, Copy)]
pub(crate) struct SurfaceSums([[f32; LANES]; 7]);

impl Cell {
    pub fn n(&self) -> usize {
        self.n
    }
    pub fn get(&self, at: usize) -> CellPoint {
        let value = |part: usize| self.blocks[at / LANES][part][at % LANES];
        CellPoint { position: [0, 1, 2].map(value), normal: [3, 4, 5].map(value), levers: [6, 7].map(value) }
    }
    pub fn set(&mut self, at: usize, point: CellPoint) {
        let CellPoint { position, normal, levers } = point;
        let block = &mut self.blocks[at / LANES];
        for (part, value) in block.iter_mut().zip(position.into_iter().chain(normal).chain(levers)) {
            part[at % LANES] = value;
        }
    }
    pub fn push(&mut self, point: CellPoint) {
        if self.n.is_multiple_of(LANES) {
            // Most cells have one block; the first push would reserve four.
            self.blocks.reserve_exact(1);
            self.blocks.push([
                [UNUSED; LANES],
                [UNUSED; LANES],
                [UNUSED; LANES],
                [0.0; LANES],
                [0.0; LANES],
                [0.0; LANES],
                [0.0; LANES],
                [0.0; LANES],
            ]);
        }
        self.n += 1;
        self.set(self.n - 1, point);
    }
    /// Removes the first point, which is the oldest.
    pub fn drop_first(&mut self) {
        for at in 1..self.n {
            self.set(at - 1, self.get(at));
        }
        self.n -= 1;
        self.set(self.n, CellPoint { position: [UNUSED; 3], normal: [0.0; 3], levers: [0.0; 2] });
        self.blocks.truncate(self.n.div_ceil(LANES));
    }
    /// Index of the first point in `cube`, where `per_side` cubes fill the cell's side.
    #[inline(always)]
    pub fn in_cube(&self, cube: [f32; 3], per_side: f32) -> Option<usize> {
        self.blocks.iter().enumerate().find_map(|(number, [x, y, z, ..])| {
            let mut is_in = [false; LANES];
            for lane in 0..LANES {
                let inside = |v: f32, low: f32| (v * per_side >= low) & (v * per_side < low + 1.0);
                is_in[lane] = inside(x[lane], cube[0]) & inside(y[lane], cube[1]) & inside(z[lane], cube[2]);
            }
            is_in.iter().position(|is_in| *is_in).map(|lane| number * LANES + lane)
        })
    }
    /// Adds the points around a position (m, relative to the cell's corner) that belong to its surface, see
    /// [`crate::LocalMap::surface`].
    #[inline(always)]
    pub fn add_surface(&self, position: [f32; 3], normal: [f32; 3], kernel: &Kernel, sums: &mut SurfaceSums) {
        let limit = (kernel.radius_m * kernel.radius_m) as f32;
        let per_limit = 1.0 / limit;
        for [x, y, z, nx, ny, nz, elevation, turn] in &self.blocks {
            let mut squares = [0.0; LANES];
            let mut weights = [0.0; LANES];
            let mut heights = [0.0; LANES];
            for lane in 0..LANES {
                let d = [position[0] - x[lane], position[1] - y[lane], position[2] - z[lane]];
                let squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                let cosine = nx[lane] * normal[0] + ny[lane] * normal[1] + nz[lane] * normal[2];
                let near = 1.0 - squared * per_limit;
                weights[lane] = if (squared < limit) & (cosine > SAME_SURFACE) { near * near } else { 0.0 };
                squares[lane] = squared;
                heights[lane] = nx[lane] * d[0] + ny[lane] * d[1] + nz[lane] * d[2];
            }
            if let Weights::Gaussian { h_m } = kernel.weights {
                for (weight, squared) in weights.iter_mut().zip(squares).filter(|(weight, _)| **weight > 0.0) {
                    *weight = (-squared / (h_m * h_m) as f32).exp();
                }
            }
            let [sum_w, sum_h, sum_x, sum_y, sum_z, sum_elevation, sum_turn] = &mut sums.0;
            for lane in 0..LANES {
                let w = weights[lane];
                sum_w[lane] += w;
                sum_h[lane] += w * heights[lane];
                sum_x[lane] += w * nx[lane];
                sum_y[lane] += w * ny[lane];
                sum_z[lane] += w * nz[lane];
                sum_elevation[lane] += w * elevation[lane];
                sum_turn[lane] += w * turn[lane];
            }
        }
    }
}

impl SurfaceSums {
    pub fn zero() -> Self {
        Self([[0.0; LANES]; 7])
    }
    /// Weight, weighted distance, weighted normal, weighted levers.
    #[inline(always)]
    pub fn totals(&self) -> [f64; 7] {
        let mut totals = [0.0; 7];
        // Few lanes have a weight. The sums of the others are zero.
        for lane in (0..LANES).filter(|lane| self.0[0][*lane] > 0.0) {
            for (total, lanes) in totals.iter_mut().zip(&self.0) {
                *total += f64::from(lanes[lane]);
            }
        }
        totals
    }
}
