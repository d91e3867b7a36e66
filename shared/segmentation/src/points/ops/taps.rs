//! Where a convolution reads its input: for each output row the items of a list, each with weights for the taps of a kernel.

use super::lists::Lists;
use std::sync::Arc;

/// The input rows of a convolution, spread over the taps of its kernel.
pub(super) trait Taps: Sync {
    /// Number of output rows.
    fn n_rows(&self) -> usize;
    /// Number of taps of the kernel.
    fn n_taps(&self) -> usize;
    /// Adds the weighted input rows of an output row to the channels of each tap, `n_taps x n_columns` values.
    fn add(&self, row: usize, input: &[f32], n_columns: usize, out: &mut [f32]);
}

/// Lanes of a block of kernel points.
const LANES: usize = 16;
/// Coordinate of unused lanes: far from everything.
const FAR: f32 = 1e18;

/// Kernel points of a point convolution (Thomas et al. 2019). A neighbor at distance d of a kernel point has the influence
/// `max(0, 1 - d / extent)` on it.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelPoints {
    n: usize,
    /// Coordinates by axis.
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
    /// Queries read support points.
    pub fn forward(at: &'a Neighborhood, kernel: &'a KernelPoints) -> Self {
        Self { lists: &at.lists, rows: &at.queries, items: &at.support, sign: 1.0, kernel }
    }
    /// Support points read queries: the gradient of the input.
    pub fn backward(at: &'a Neighborhood, kernel: &'a KernelPoints) -> Self {
        Self { lists: &at.lists.transposed().0, rows: &at.support, items: &at.queries, sign: -1.0, kernel }
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
    fn add(&self, row: usize, input: &[f32], n_columns: usize, out: &mut [f32]) {
        let center = self.rows[row];
        for item in self.lists.of(row) {
            let position = self.items[*item as usize];
            let offset: [f32; 3] = std::array::from_fn(|axis| self.sign * (position[axis] - center[axis]));
            let input = &input[*item as usize * n_columns..(*item as usize + 1) * n_columns];
            for (block_idx, block) in self.kernel.blocks.iter().enumerate() {
                let influences: [f32; LANES] = std::array::from_fn(|lane| {
                    let [dx, dy, dz] = [offset[0] - block[0][lane], offset[1] - block[1][lane], offset[2] - block[2][lane]];
                    1.0 - (dx * dx + dy * dy + dz * dz).sqrt() * self.kernel.per_extent
                });
                // Without branches: each tap is written, and the next one overwrites it if it has no influence.
                let (mut taps, mut n) = ([0_usize; LANES + 1], 0);
                for (lane, influence) in influences.iter().enumerate() {
                    taps[n.min(LANES)] = lane;
                    n += usize::from(*influence > 0.0);
                }
                for tap in &taps[..n] {
                    let influence = influences[*tap];
                    let start = (block_idx * LANES + tap) * n_columns;
                    let out = &mut out[start..start + n_columns];
                    out.iter_mut().zip(input).for_each(|(out, input)| *out += influence * input);
                }
            }
        }
    }
}
