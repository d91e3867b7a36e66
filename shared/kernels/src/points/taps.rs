//! Inputs of a convolution: for each output row the items of a list, each with weights for the taps of a kernel.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds are what the compiler makes vectors of; iterators and calls in between are not"
)]

use super::lists::Lists;
use pulp::Simd;
use std::sync::Arc;

/// The input rows of a convolution, spread over the taps of its kernel.
pub(super) trait Taps: Sync {
    /// Number of output rows.
    fn n_rows(&self) -> usize;
    /// Number of taps of the kernel.
    fn n_taps(&self) -> usize;
    /// Adds the weighted input rows of an output row to the channels of each tap, `n_taps x n_columns` values.
    fn add<S: Simd>(&self, simd: S, row: usize, input: &[f32], n_columns: usize, out: &mut [f32]);
}

/// Lanes of a block of kernel points.
const LANES: usize = 16;
/// Coordinate of unused lanes, far from all points.
const FAR: f32 = 1e18;

/// Kernel points of a point convolution (Thomas et al. 2019). A neighbor at distance d of a kernel point has the influence
/// `max(0, 1 - d / extent)` on it.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelPoints {
    n: usize,
    /// Coordinates per axis.
    blocks: Vec<[[f32; LANES]; 3]>,
    per_extent: f32,
}

impl KernelPoints {
    /// Kernel points relative to the query point, m, and the extent of their influence, m.
    pub fn new(points: &[[f32; 3]], extent_m: f32) -> Self {
        let block = |points: &[[f32; 3]]| {
            std::array::from_fn(|axis| std::array::from_fn(|lane| points.get(lane).map_or(FAR, |p| p[axis])))
        };
        Self { n: points.len(), blocks: points.chunks(LANES).map(block).collect(), per_extent: 1.0 / extent_m }
    }
    /// Number of kernel points.
    pub fn len(&self) -> usize {
        self.n
    }
    /// Whether there are no kernel points.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }
}

/// The neighbors of queries among support points.
#[derive(Clone, Debug)]
pub struct Neighborhood {
    /// Positions of the queries, m.
    pub queries: Arc<Vec<[f32; 3]>>,
    /// Positions of the support points, m.
    pub support: Arc<Vec<[f32; 3]>>,
    /// Support points near each query.
    pub lists: Arc<Lists>,
}

/// Taps of kernel points.
pub(super) struct KernelTaps<'a> {
    lists: &'a Lists,
    rows: &'a [[f32; 3]],
    items: &'a [[f32; 3]],
    /// -1 if rows and items are exchanged.
    sign: f32,
    kernel: &'a KernelPoints,
}

impl<'a> KernelTaps<'a> {
    /// Taps for queries that read support points.
    pub fn forward(at: &'a Neighborhood, kernel: &'a KernelPoints) -> Self {
        Self { lists: &at.lists, rows: &at.queries, items: &at.support, sign: 1.0, kernel }
    }
    /// Taps for support points that read queries: the gradient of the input.
    pub fn backward(at: &'a Neighborhood, kernel: &'a KernelPoints) -> Self {
        Self { lists: &at.lists.transposed().lists, rows: &at.support, items: &at.queries, sign: -1.0, kernel }
    }
}

impl Taps for KernelTaps<'_> {
    fn n_rows(&self) -> usize {
        self.lists.len()
    }
    fn n_taps(&self) -> usize {
        self.kernel.n
    }
    #[inline(always)]
    fn add<S: Simd>(&self, simd: S, row: usize, input: &[f32], n_columns: usize, out: &mut [f32]) {
        let center = self.rows[row];
        for item in self.lists.get(row) {
            let position = self.items[*item as usize];
            let offset = [
                self.sign * (position[0] - center[0]),
                self.sign * (position[1] - center[1]),
                self.sign * (position[2] - center[2]),
            ];
            let input = &input[*item as usize * n_columns..(*item as usize + 1) * n_columns];
            for (block_idx, block) in self.kernel.blocks.iter().enumerate() {
                let mut influences = [0.0_f32; LANES];
                for lane in 0..LANES {
                    let dx = offset[0] - block[0][lane];
                    let dy = offset[1] - block[1][lane];
                    let dz = offset[2] - block[2][lane];
                    influences[lane] = 1.0 - (dx * dx + dy * dy + dz * dz).sqrt() * self.kernel.per_extent;
                }
                // The bits of the few kernel points with influence.
                let mut bits = 0_u32;
                for lane in 0..LANES {
                    bits |= u32::from(influences[lane] > 0.0) << lane;
                }
                while bits != 0 {
                    let tap = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let start = (block_idx * LANES + tap) * n_columns;
                    add_weighted(simd, &mut out[start..start + n_columns], input, influences[tap]);
                }
            }
        }
    }
}

/// `out += weight * input`.
#[inline(always)]
fn add_weighted<S: Simd>(simd: S, out: &mut [f32], input: &[f32], weight: f32) {
    let (vectors, rest) = S::as_mut_simd_f32s(out);
    let (input_vectors, input_rest) = S::as_simd_f32s(input);
    let weights = simd.splat_f32s(weight);
    for (out, input) in vectors.iter_mut().zip(input_vectors) {
        *out = simd.mul_add_f32s(weights, *input, *out);
    }
    rest.iter_mut().zip(input_rest).for_each(|(out, input)| *out += weight * input);
}
