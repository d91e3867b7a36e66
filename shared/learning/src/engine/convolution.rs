//! Direct convolution, with bias and rectifier.

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use super::planes::{BORDER, Feature, LANES, Planes, blocks};
use super::winograd;
use pulp::{Arch, Simd, WithSimd};

/// Form of a convolution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Rows and columns of the filter: 1, 3 or 5.
    pub kernel: [usize; 2],
    /// Every how many-th column has an output: 1 or 2. Output column x is centered on input column `stride_x * x`.
    pub stride_x: usize,
    /// Channels of each source; they are read as if they were one image.
    pub in_channels: Vec<usize>,
    /// Channels of the result.
    pub out_channels: usize,
    /// Whether results below zero become zero.
    pub rectify: bool,
}

impl Shape {
    /// Blocks of all sources.
    pub fn in_blocks(&self) -> usize {
        self.in_channels.iter().map(|&channels| blocks(channels)).sum()
    }
    /// Rows of 16 weights of one output block.
    fn rows_per_block(&self) -> usize {
        self.in_blocks() * self.kernel[0] * self.kernel[1] * LANES
    }
    /// Rows of 16 numbers of a filter of this shape: its weights and then its biases.
    pub fn packed_rows(&self) -> usize {
        blocks(self.out_channels) * (self.rows_per_block() + 1)
    }
    /// Place of weight `[out, in, row, column]` (`PyTorch`'s order) in the packed filter: row and lane.
    pub fn place(&self, out: usize, input: usize, [row, column]: [usize; 2]) -> (usize, usize) {
        let (mut block, mut channel) = (0, input);
        for &channels in &self.in_channels {
            if channel < channels {
                break;
            }
            channel -= channels;
            block += blocks(channels);
        }
        let block = block + channel / LANES;
        let tap = ((out / LANES * self.in_blocks() + block) * self.kernel[0] + row) * self.kernel[1] + column;
        (tap * LANES + channel % LANES, out % LANES)
    }
    /// Place of a bias in the packed filter.
    pub fn bias_place(&self, out: usize) -> (usize, usize) {
        (blocks(self.out_channels) * self.rows_per_block() + out / LANES, out % LANES)
    }
    /// Weights in `PyTorch`'s order `[out, in, row, column]` and biases from rows in packed order.
    pub fn unpacked(&self, packed: &[Feature]) -> (Vec<f32>, Vec<f32>) {
        let n_in: usize = self.in_channels.iter().sum();
        let [rows, columns] = self.kernel;
        let weight = |i: usize| {
            let (input, out) = (i / (rows * columns) % n_in, i / (rows * columns * n_in));
            let (row, lane) = self.place(out, input, [i / columns % rows, i % columns]);
            packed[row][lane]
        };
        let bias = |out: usize| {
            let (row, lane) = self.bias_place(out);
            packed[row][lane]
        };
        let n_weights = self.out_channels * n_in * rows * columns;
        ((0..n_weights).map(weight).collect(), (0..self.out_channels).map(bias).collect())
    }
    /// Columns of the result.
    pub fn out_width(&self, width: usize) -> usize {
        width / self.stride_x
    }
}

/// Weights and biases in the order in which the kernel reads them: by output block, input block, row, column, input
/// channel, each a row of 16 output channels; then the biases.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Form.
    pub shape: Shape,
    packed: Vec<Feature>,
    /// For the kernel of 3 x 3 filters of stride 1; else empty.
    transformed: Vec<Feature>,
}

impl Filter {
    /// From rows in packed order.
    ///
    /// # Panics
    /// If there are not [`Shape::packed_rows`] rows.
    pub fn from_packed(shape: Shape, packed: Vec<Feature>) -> Self {
        assert_eq!(packed.len(), shape.packed_rows());
        let is_tiled = winograd::fits(&shape, 0, 0);
        let transformed = if is_tiled { winograd::transformed(&shape, &packed) } else { Vec::new() };
        Self { shape, packed, transformed }
    }
    /// From weights in `PyTorch`'s order `[out, in, row, column]` and biases.
    ///
    /// # Panics
    /// If the numbers are not as many as the shape says.
    pub fn new(shape: Shape, weights: &[f32], biases: &[f32]) -> Self {
        let n_in: usize = shape.in_channels.iter().sum();
        let [rows, columns] = shape.kernel;
        assert_eq!(weights.len(), shape.out_channels * n_in * rows * columns);
        assert_eq!(biases.len(), shape.out_channels);
        let mut packed = vec![[0.0; LANES]; shape.packed_rows()];
        for (i, &weight) in weights.iter().enumerate() {
            let (column, row) = (i % columns, i / columns % rows);
            let (input, out) = (i / (rows * columns) % n_in, i / (rows * columns * n_in));
            let (at, lane) = shape.place(out, input, [row, column]);
            packed[at][lane] = weight;
        }
        for (out, &bias) in biases.iter().enumerate() {
            let (at, lane) = shape.bias_place(out);
            packed[at][lane] = bias;
        }
        Self::from_packed(shape, packed)
    }
    /// Weight `[out, in, row, column]`.
    pub(super) fn weight(&self, out: usize, input: usize, tap: [usize; 2]) -> f32 {
        let (row, lane) = self.shape.place(out, input, tap);
        self.packed[row][lane]
    }
    pub(super) fn bias(&self, out_block: usize) -> &Feature {
        &self.packed[blocks(self.shape.out_channels) * self.shape.rows_per_block() + out_block]
    }
    /// The 16 rows of one tap.
    #[inline(always)]
    fn tap(&self, out_block: usize, tap: usize) -> &[Feature] {
        &self.packed[out_block * self.shape.rows_per_block() + tap * LANES..][..LANES]
    }
    /// Multiplications and additions for one output pixel, without the zeros that fill up blocks.
    pub fn flops_per_pixel(&self) -> usize {
        let n_in: usize = self.shape.in_channels.iter().sum();
        2 * n_in * self.shape.out_channels * self.shape.kernel[0] * self.shape.kernel[1]
    }
}

/// Applies a filter to images of one size, borders filled, and writes all but the border of `out`.
///
/// # Panics
/// If the sources are not as the filter's shape says, or `out` is not of the size of the result.
pub fn convolve(filter: &Filter, sources: &[&Planes], out: &mut Planes) {
    let shape = &filter.shape;
    let channels: Vec<usize> = sources.iter().map(|source| source.channels()).collect();
    assert_eq!(channels, shape.in_channels);
    let (height, width) = (sources[0].height(), sources[0].width());
    assert!(sources.iter().all(|source| (source.height(), source.width()) == (height, width)));
    assert_eq!(width % shape.stride_x, 0, "a stride must divide the width");
    let expected = (shape.out_channels, height, shape.out_width(width));
    assert_eq!((out.channels(), out.height(), out.width()), expected);
    if winograd::fits(shape, height, width) {
        Arch::new().dispatch(winograd::Job { filter, transformed: &filter.transformed, sources, out });
    } else {
        Arch::new().dispatch(Job { filter, sources, out });
    }
}

struct Job<'a> {
    filter: &'a Filter,
    sources: &'a [&'a Planes],
    out: &'a mut Planes,
}

impl WithSimd for Job<'_> {
    type Output = ();

    // Tiles of pixels x output blocks whose sums fit into the registers: 16 to 24 of 32 (AVX-512), 8 of 16 (AVX2) hide the
    // latency of the multiply-adds.
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n_blocks = self.out.n_blocks();
        // All blocks of a row before the next row: what they read of the sources then stays in the cache.
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
    /// One row of `C` output blocks from `block`, and `C`. `N` registers make 16 lanes; tiles of `P` pixels; stride `SX`.
    #[inline(always)]
    fn row<S: Simd, const N: usize, const P: usize, const C: usize, const SX: usize>(
        &mut self,
        simd: S,
        block: usize,
        y: usize,
    ) -> usize {
        let (filter, sources, width) = (self.filter, self.sources, self.out.width());
        let mut x = 0;
        while x + P <= width {
            let sums = tile::<S, N, P, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, P, C>(simd, filter, &sums, self.out, block, y, x);
            x += P;
        }
        while x + 4 <= width {
            let sums = tile::<S, N, 4, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, 4, C>(simd, filter, &sums, self.out, block, y, x);
            x += 4;
        }
        while x < width {
            let sums = tile::<S, N, 1, C, SX>(simd, filter, sources, block, y, x);
            store::<S, N, 1, C>(simd, filter, &sums, self.out, block, y, x);
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
    sources: &[&Planes],
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
                // Nothing but zeros above and below the image.
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

/// Adds what one block of input channels gives to `P` pixels, `SX` apart, and `C` output blocks.
#[inline(always)]
pub(super) fn add_products<S: Simd, const N: usize, const P: usize, const C: usize, const SX: usize>(
    simd: S,
    sums: &mut [[[S::f32s; N]; C]; P],
    n_channels: usize,
    pixels: &[Feature],
    weights: [&[Feature]; C],
) {
    let zero = simd.splat_f32s(0.0);
    let pixels = &pixels[..=(P - 1) * SX];
    for channel in 0..n_channels {
        let mut of_channel = [[zero; N]; C];
        for c in 0..C {
            let weights = S::as_simd_f32s(&weights[c][channel]).0;
            for n in 0..N {
                of_channel[c][n] = weights[n];
            }
        }
        for p in 0..P {
            let value = simd.splat_f32s(pixels[p * SX][channel]);
            for c in 0..C {
                for n in 0..N {
                    sums[p][c][n] = simd.mul_add_f32s(value, of_channel[c][n], sums[p][c][n]);
                }
            }
        }
    }
}

#[inline(always)]
fn store<S: Simd, const N: usize, const P: usize, const C: usize>(
    simd: S,
    filter: &Filter,
    sums: &[[[S::f32s; N]; C]; P],
    out: &mut Planes,
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
