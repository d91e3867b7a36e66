//! Direct convolution with bias and rectifier (`ReLU`).

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use super::filter::Filter;
use super::planes::{BORDER, LANES, PlanesMut, PlanesRef};
use super::products::add_products;
use pulp::{Simd, WithSimd};

/// The direct convolution of any filter.
pub(super) struct Job<'a> {
    pub(super) filter: &'a Filter,
    pub(super) sources: &'a [PlanesRef<'a>],
    pub(super) out: PlanesMut<'a>,
}

impl WithSimd for Job<'_> {
    type Output = ();

    // Tile sizes (pixels x output blocks) whose sums fit into registers. 16 to 24 of 32 registers (AVX-512) or 8 of 16
    // (AVX2) hide the latency of the multiply-adds.
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n_blocks = self.out.n_blocks();
        // All blocks of a row before the next row, so that the rows of the sources stay in the cache.
        for y in 0..self.out.height() {
            let mut block = 0;
            while block < n_blocks {
                let many = if S::F32_LANES == 16 { n_blocks - block } else { 1 };
                block += match (S::F32_LANES, self.filter.shape.stride_x, many) {
                    (16, 1, 1) => self.row::<S, 1, 16, 1, 1>(simd, block, y),
                    (16, 1, 2 | 4) => self.row::<S, 1, 12, 2, 1>(simd, block, y),
                    (16, 1, _) => self.row::<S, 1, 8, 3, 1>(simd, block, y),
                    (16, _, 1) => self.row::<S, 1, 8, 1, 2>(simd, block, y),
                    (16, _, _) => self.row::<S, 1, 8, 2, 2>(simd, block, y),
                    (8, 1, _) => self.row::<S, 2, 4, 1, 1>(simd, block, y),
                    (8, _, _) => self.row::<S, 2, 4, 1, 2>(simd, block, y),
                    (4, 1, _) => self.row::<S, 4, 2, 1, 1>(simd, block, y),
                    (4, _, _) => self.row::<S, 4, 2, 1, 2>(simd, block, y),
                    (_, 1, _) => self.row::<S, 16, 1, 1, 1>(simd, block, y),
                    _ => self.row::<S, 16, 1, 1, 2>(simd, block, y),
                };
            }
        }
    }
}

impl Job<'_> {
    /// Computes one row of `C` output blocks from `block`, and returns `C`. `N` registers hold 16 lanes, tiles have `P` pixels, the
    /// stride is `SX`.
    #[inline(always)]
    fn row<S: Simd, const N: usize, const P: usize, const C: usize, const SX: usize>(
        &mut self,
        simd: S,
        block: usize,
        y: usize,
    ) -> usize {
        let filter = self.filter;
        let sources = self.sources;
        let width = self.out.width();
        let mut x = 0;
        while x + P <= width {
            let sums = tile::<S, N, P, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, P, C>(simd, filter, &sums, &mut self.out, block, y, x);
            x += P;
        }
        while x + 4 <= width {
            let sums = tile::<S, N, 4, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, 4, C>(simd, filter, &sums, &mut self.out, block, y, x);
            x += 4;
        }
        while x < width {
            let sums = tile::<S, N, 1, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, 1, C>(simd, filter, &sums, &mut self.out, block, y, x);
            x += 1;
        }
        C
    }
}

/// Sums of `P` pixels from column `x` of row `y` and `C` output blocks.
#[inline(always)]
fn tile<S: Simd, const N: usize, const P: usize, const C: usize, const SX: usize>(
    simd: S,
    filter: &Filter,
    sources: &[PlanesRef<'_>],
    block: usize,
    y: usize,
    x: usize,
) -> [[[S::f32s; N]; C]; P] {
    let [rows, columns] = filter.shape.kernel;
    let zero = simd.splat_f32s(0.0);
    let mut sums = [[[zero; N]; C]; P];
    for c in 0..C {
        let bias = S::as_simd_f32s(filter.bias(block + c)).0;
        for p in 0..P {
            for n in 0..N {
                sums[p][c][n] = bias[n];
            }
        }
    }
    let mut tap = 0;
    for source in sources {
        for source_block in 0..source.n_blocks() {
            let plane = source.plane(source_block);
            let n_channels = (source.channels() - source_block * LANES).min(LANES);
            for row in 0..rows {
                // The padding above and below the image is zero.
                if y + row < rows / 2 || y + row >= source.height() + rows / 2 {
                    tap += columns;
                    continue;
                }
                let first = (y + BORDER + row - rows / 2) * source.pitch() + BORDER + x * SX - columns / 2;
                for column in 0..columns {
                    let pixels = &plane[first + column..];
                    let mut weights = [filter.tap(block, tap); C];
                    for c in 1..C {
                        weights[c] = filter.tap(block + c, tap);
                    }
                    add_products::<S, N, P, C, SX>(simd, &mut sums, n_channels, pixels, weights);
                    tap += 1;
                }
            }
        }
    }
    sums
}

#[inline(always)]
fn store<S: Simd, const N: usize, const P: usize, const C: usize>(
    simd: S,
    filter: &Filter,
    sums: &[[[S::f32s; N]; C]; P],
    out: &mut PlanesMut<'_>,
    block: usize,
    y: usize,
    x: usize,
) {
    let zero = simd.splat_f32s(0.0);
    for c in 0..C {
        let pixels = &mut out.row_mut(block + c, y)[x..x + P];
        for p in 0..P {
            let lanes = S::as_mut_simd_f32s(&mut pixels[p]).0;
            for n in 0..N {
                lanes[n] = if filter.shape.rectify { simd.max_f32s(sums[p][c][n], zero) } else { sums[p][c][n] };
            }
        }
    }
}
