//! 3 x 3 convolution by Winograd's minimal filtering, with a quarter of the multiplications.
//!
//! F(4 x 4, 3 x 3) of Lavin and Gray, "Fast algorithms for convolutional neural networks" (2016): tiles of 6 x 6 pixels and
//! filters are transformed to 36 values each, these are multiplied and summed over the channels, and the sums are transformed
//! back to 4 x 4 pixels. The points are 0, +-1/sqrt 2, +-sqrt 2 and infinity; 0, +-1, +-2 give larger rounding errors.

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use super::filter::Filter;
use super::planes::{BORDER, Feature, LANES, PlanesMut, PlanesRef, blocks};
use super::products::add_products;
use super::winograd_filter::{IN, OUT, VALUES};
use pulp::{Simd, WithSimd};
use std::cell::Cell;
use std::f32::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Tiles that are processed together: their values fit the second-level cache, and the number is a multiple of all register tiles.
const TILES: usize = 24;

thread_local! {
    /// Buffers for values and sums, reused because clearing new memory takes as long as transforming it.
    static SCRATCH: Cell<(Vec<Feature>, Vec<Feature>)> = const { Cell::new((Vec::new(), Vec::new())) };
}

/// The convolution with a filter that [`fits`](super::winograd_filter::fits).
pub(super) struct Job<'a> {
    pub(super) filter: &'a Filter,
    pub(super) sources: &'a [PlanesRef<'a>],
    pub(super) out: PlanesMut<'a>,
}

impl WithSimd for Job<'_> {
    type Output = ();

    // Tile sizes (tiles x output blocks) whose sums fit into registers: 24 of 32 (AVX-512), 12 of 16 (AVX2).
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        match S::F32_LANES {
            16 => self.all::<S, 1>(simd),
            8 => self.all::<S, 2>(simd),
            4 => self.all::<S, 4>(simd),
            _ => self.all::<S, 16>(simd),
        }
    }
}

impl Job<'_> {
    /// `N` registers hold 16 lanes.
    #[inline(always)]
    fn all<S: Simd, const N: usize>(&mut self, simd: S) {
        let in_blocks = self.filter.shape.in_blocks();
        // One more than needed, so that the values of a tile do not all map to the same cache set.
        let pitch = in_blocks * TILES + 1;
        let (mut inputs, mut sums) = SCRATCH.take();
        inputs.resize(inputs.len().max(VALUES * pitch), [0.0; LANES]);
        sums.resize(VALUES * (4 * TILES + 1), [0.0; LANES]);
        let n_tiles = self.out.height() / OUT * (self.out.width() / OUT);
        for first in (0..n_tiles).step_by(TILES) {
            let tiles = first..n_tiles.min(first + TILES);
            let mut at = 0;
            for source in self.sources {
                for block in 0..source.n_blocks() {
                    for (i, tile) in tiles.clone().enumerate() {
                        read_tile::<S, N>(simd, source, block, tile, &mut inputs[at + i..], pitch);
                    }
                    at += TILES;
                }
            }
            let n_blocks = self.out.n_blocks();
            let mut block = 0;
            while block < n_blocks {
                block += match (N, n_blocks - block) {
                    (1, 1) => self.blocks::<S, N, 24, 1>(simd, block, tiles.clone(), &inputs, &mut sums),
                    (1, 2 | 5) => self.blocks::<S, N, 12, 2>(simd, block, tiles.clone(), &inputs, &mut sums),
                    (1, 3 | 6) => self.blocks::<S, N, 8, 3>(simd, block, tiles.clone(), &inputs, &mut sums),
                    (1, _) => self.blocks::<S, N, 6, 4>(simd, block, tiles.clone(), &inputs, &mut sums),
                    (2, _) => self.blocks::<S, N, 6, 1>(simd, block, tiles.clone(), &inputs, &mut sums),
                    (4, _) => self.blocks::<S, N, 3, 1>(simd, block, tiles.clone(), &inputs, &mut sums),
                    _ => self.blocks::<S, N, 1, 1>(simd, block, tiles.clone(), &inputs, &mut sums),
                };
            }
        }
        SCRATCH.set((inputs, sums));
    }

    /// Computes `C` output blocks of some tiles, `P` at once, and returns `C`.
    #[inline(always)]
    fn blocks<S: Simd, const N: usize, const P: usize, const C: usize>(
        &mut self,
        simd: S,
        block: usize,
        tiles: std::ops::Range<usize>,
        inputs: &[Feature],
        sums: &mut [Feature],
    ) -> usize {
        let pitch = C * TILES + 1;
        for value in 0..VALUES {
            for first in (0..tiles.len()).step_by(P) {
                let of_tiles = self.products::<S, N, P, C>(simd, block, value, inputs, first);
                for c in 0..C {
                    let sums = &mut sums[value * pitch + c * TILES + first..][..P];
                    for p in 0..P {
                        let lanes = S::as_mut_simd_f32s(&mut sums[p]).0;
                        for n in 0..N {
                            lanes[n] = of_tiles[p][c][n];
                        }
                    }
                }
            }
        }
        for c in 0..C {
            for (i, tile) in tiles.clone().enumerate() {
                let sums = &sums[c * TILES + i..];
                write_tile::<S, N>(simd, self.filter, sums, pitch, &mut self.out, block + c, tile);
            }
        }
        C
    }

    /// Sums over the input channels of one value of `P` tiles from `first` and `C` output blocks.
    #[inline(always)]
    fn products<S: Simd, const N: usize, const P: usize, const C: usize>(
        &self,
        simd: S,
        block: usize,
        value: usize,
        inputs: &[Feature],
        first: usize,
    ) -> [[[S::f32s; N]; C]; P] {
        let shape = &self.filter.shape;
        let in_blocks = shape.in_blocks();
        let of_value = &inputs[value * (in_blocks * TILES + 1)..][..in_blocks * TILES];
        let zero = simd.splat_f32s(0.0);
        let mut sums = [[[zero; N]; C]; P];
        let mut in_block = 0;
        for &channels in &shape.in_channels {
            for source_block in 0..blocks(channels) {
                let n_channels = (channels - source_block * LANES).min(LANES);
                let pixels = &of_value[in_block * TILES + first..];
                let mut weights = [self.weights(value, block, in_block); C];
                for c in 1..C {
                    weights[c] = self.weights(value, block + c, in_block);
                }
                add_products::<S, N, P, C, 1>(simd, &mut sums, n_channels, pixels, weights);
                in_block += 1;
            }
        }
        sums
    }

    /// The 16 rows of one value, output block and input block.
    #[inline(always)]
    fn weights(&self, value: usize, block: usize, in_block: usize) -> &[Feature] {
        let shape = &self.filter.shape;
        let row = (value * blocks(shape.out_channels) + block) * shape.in_blocks() + in_block;
        &self.filter.transformed()[row * LANES..][..LANES]
    }
}

/// Row and column of the first pixel of a tile.
#[inline(always)]
fn place(tile: usize, width: usize) -> [usize; 2] {
    let per_row = width / OUT;
    [tile / per_row * OUT, tile % per_row * OUT]
}

/// Transforms a tile of an image into values, `pitch` apart.
#[inline(always)]
fn read_tile<S: Simd, const N: usize>(
    simd: S,
    source: &PlanesRef<'_>,
    block: usize,
    tile: usize,
    values: &mut [Feature],
    pitch: usize,
) {
    let [y, x] = place(tile, source.width());
    let first = (y + BORDER - 1) * source.pitch() + x + BORDER - 1;
    let pixels = &source.plane(block)[first..];
    for n in 0..N {
        let mut tile = [[simd.splat_f32s(0.0); IN]; IN];
        for x in 0..IN {
            let mut column = [simd.splat_f32s(0.0); IN];
            for y in 0..IN {
                column[y] = S::as_simd_f32s(&pixels[y * source.pitch() + x]).0[n];
            }
            let column = values_of_pixels(simd, column);
            for y in 0..IN {
                tile[y][x] = column[y];
            }
        }
        for y in 0..IN {
            let row = values_of_pixels(simd, tile[y]);
            for x in 0..IN {
                S::as_mut_simd_f32s(&mut values[(y * IN + x) * pitch]).0[n] = row[x];
            }
        }
    }
}

/// Transforms the sums of a tile, `pitch` apart, into pixels, with bias and rectifier.
#[inline(always)]
fn write_tile<S: Simd, const N: usize>(
    simd: S,
    filter: &Filter,
    sums: &[Feature],
    pitch: usize,
    out: &mut PlanesMut<'_>,
    block: usize,
    tile: usize,
) {
    let [first_y, first_x] = place(tile, out.width());
    let zero = simd.splat_f32s(0.0);
    for n in 0..N {
        let bias = S::as_simd_f32s(filter.bias(block)).0[n];
        let mut tile = [[zero; IN]; OUT];
        for x in 0..IN {
            let mut column = [zero; IN];
            for y in 0..IN {
                column[y] = S::as_simd_f32s(&sums[(y * IN + x) * pitch]).0[n];
            }
            let column = pixels_of_sums(simd, column);
            for y in 0..OUT {
                tile[y][x] = column[y];
            }
        }
        for y in 0..OUT {
            let row = pixels_of_sums(simd, tile[y]);
            let pixels = &mut out.row_mut(block, first_y + y)[first_x..][..OUT];
            for x in 0..OUT {
                let value = simd.add_f32s(row[x], bias);
                let value = if filter.shape.rectify { simd.max_f32s(value, zero) } else { value };
                S::as_mut_simd_f32s(&mut pixels[x]).0[n] = value;
            }
        }
    }
}

/// The values of the polynomial of six pixels at the points.
#[inline(always)]
fn values_of_pixels<S: Simd>(simd: S, p: [S::f32s; IN]) -> [S::f32s; IN] {
    let add = |factor: f32, value, to| simd.mul_add_f32s(simd.splat_f32s(factor), value, to);
    let times = |factor: f32, value| simd.mul_f32s(simd.splat_f32s(factor), value);
    let even = add(-2.0, p[2], p[4]);
    let odd = add(FRAC_1_SQRT_2, p[3], times(-SQRT_2, p[1]));
    let even_far = add(-0.5, p[2], p[4]);
    let odd_far = add(SQRT_2, p[3], times(-FRAC_1_SQRT_2, p[1]));
    [
        add(-2.5, p[2], simd.add_f32s(p[0], p[4])),
        simd.add_f32s(even, odd),
        simd.sub_f32s(even, odd),
        simd.add_f32s(even_far, odd_far),
        simd.sub_f32s(even_far, odd_far),
        add(-2.5, p[3], simd.add_f32s(p[1], p[5])),
    ]
}

/// Four pixels from the values of the product at the points.
#[inline(always)]
fn pixels_of_sums<S: Simd>(simd: S, s: [S::f32s; IN]) -> [S::f32s; OUT] {
    let add = |factor: f32, value, to| simd.mul_add_f32s(simd.splat_f32s(factor), value, to);
    let times = |factor: f32, value| simd.mul_f32s(simd.splat_f32s(factor), value);
    let even = simd.add_f32s(s[1], s[2]);
    let odd = simd.sub_f32s(s[1], s[2]);
    let even_far = simd.add_f32s(s[3], s[4]);
    let odd_far = simd.sub_f32s(s[3], s[4]);
    [
        simd.add_f32s(s[0], simd.add_f32s(even, even_far)),
        add(SQRT_2, odd_far, times(FRAC_1_SQRT_2, odd)),
        add(2.0, even_far, times(0.5, even)),
        add(2.0 * SQRT_2, odd_far, add(0.5 * FRAC_1_SQRT_2, odd, s[5])),
    ]
}
