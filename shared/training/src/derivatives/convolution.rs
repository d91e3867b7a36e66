//! Derivatives of a convolution with respect to its filter and its sources.

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use kernels::images::{BORDER, Border, Feature, Filter, FilterPosition, LANES, Planes, Shape, blocks, convolve};
use pulp::{Arch, Simd, WithSimd};

/// Derivative with respect to the packed filter: sums over all pixels of the product of source and `gradient`. `gradient`
/// is the derivative with respect to the output before the rectifier. The borders of the sources must be filled.
///
/// # Panics
/// If the sizes do not match.
pub fn weight_gradient(shape: &Shape, sources: &[&Planes], gradient: &Planes) -> Vec<Feature> {
    assert_eq!(gradient.channels(), shape.out_channels);
    assert!(sources.iter().all(|source| shape.out_width(source.width()) == gradient.width()));
    let mut packed = vec![[0.0; LANES]; shape.packed_rows()];
    Arch::new().dispatch(Job { shape, sources, gradient, packed: &mut packed });
    packed
}

struct Job<'a> {
    shape: &'a Shape,
    sources: &'a [&'a Planes],
    gradient: &'a Planes,
    packed: &'a mut [Feature],
}

impl WithSimd for Job<'_> {
    type Output = ();

    // As many input channels at a time as registers allow: 16 of 32 registers hold sums (AVX-512), 8 of 16 (AVX2).
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            16 => self.all_taps::<S, 1, 16>(simd),
            8 => self.all_taps::<S, 2, 4>(simd),
            4 => self.all_taps::<S, 4, 2>(simd),
            _ => self.all_taps::<S, 16, 1>(simd),
        }
    }
}

impl Job<'_> {
    #[inline(always)]
    fn all_taps<S: Simd, const N: usize, const C: usize>(self, simd: S) {
        let [rows, columns] = self.shape.kernel;
        let mut at = 0;
        for out_block in 0..self.gradient.n_blocks() {
            for source in self.sources {
                for block in 0..source.n_blocks() {
                    for row in 0..rows {
                        for column in 0..columns {
                            let offset = [BORDER + row - rows / 2, BORDER + column - columns / 2];
                            let part = Part { source, block, offset, stride_x: self.shape.stride_x };
                            let n_channels = (source.channels() - block * LANES).min(LANES);
                            // The sums of padding channels are zero. Four sums take half as long as 16, because they
                            // depend on each other.
                            if n_channels <= 4 && C > 4 {
                                let out = &mut self.packed[at..at + 4];
                                part.sum::<S, N, 4>(simd, self.gradient, out_block, 0, out);
                            } else {
                                for first in (0..n_channels).step_by(C) {
                                    let out = &mut self.packed[at + first..at + first + C];
                                    part.sum::<S, N, C>(simd, self.gradient, out_block, first, out);
                                }
                            }
                            at += LANES;
                        }
                    }
                }
            }
        }
        for out_block in 0..self.gradient.n_blocks() {
            for y in 0..self.gradient.height() {
                for pixel in self.gradient.row(out_block, y) {
                    for (sum, value) in self.packed[at + out_block].iter_mut().zip(pixel) {
                        *sum += value;
                    }
                }
            }
        }
    }
}

/// One tap of one block of a source.
struct Part<'a> {
    source: &'a Planes,
    block: usize,
    offset: [usize; 2],
    stride_x: usize,
}

impl Part<'_> {
    /// Sums for `C` input channels, starting at `first`, and the 16 channels of an output block.
    #[inline(always)]
    fn sum<S: Simd, const N: usize, const C: usize>(
        &self,
        simd: S,
        gradient: &Planes,
        out_block: usize,
        first: usize,
        out: &mut [Feature],
    ) {
        let zero = simd.splat_f32s(0.0);
        let mut sums = [[zero; N]; C];
        let plane = self.source.plane(self.block);
        for y in 0..gradient.height() {
            let row = &plane[(y + self.offset[0]) * self.source.pitch() + self.offset[1]..];
            for (pixel, source) in gradient.row(out_block, y).iter().zip(row.iter().step_by(self.stride_x)) {
                let pixel = S::as_simd_f32s(pixel).0;
                let source = &source[first..first + C];
                for c in 0..C {
                    let value = simd.splat_f32s(source[c]);
                    for n in 0..N {
                        sums[c][n] = simd.mul_add_f32s(value, pixel[n], sums[c][n]);
                    }
                }
            }
        }
        for c in 0..C {
            let lanes = S::as_mut_simd_f32s(&mut out[c]).0;
            for n in 0..N {
                lanes[n] = sums[c][n];
            }
        }
    }
}

/// For each source, the filter that maps the derivative with respect to the output to the derivative with respect to the
/// source: the filter mirrored in rows and columns, with input and output channels exchanged.
pub fn transposed_filters(filter: &Filter) -> Vec<Filter> {
    let shape = &filter.shape;
    let [rows, columns] = shape.kernel;
    let mut first_input = 0;
    let of_source = |&channels: &usize| {
        let transposed = Shape {
            kernel: shape.kernel,
            stride_x: 1,
            in_channels: vec![shape.out_channels],
            out_channels: channels,
            rectify: false,
        };
        let mut packed = vec![[0.0; LANES]; transposed.packed_rows()];
        for out in 0..shape.out_channels {
            for input in 0..channels {
                for row in 0..rows {
                    for column in 0..columns {
                        let weight = filter.weight(out, first_input + input, [row, column]);
                        let mirrored = [rows - 1 - row, columns - 1 - column];
                        let FilterPosition { row: at, lane } = transposed.weight_position(input, out, mirrored);
                        packed[at][lane] = weight;
                    }
                }
            }
        }
        first_input += channels;
        Filter::from_packed(transposed, packed)
    };
    shape.in_channels.iter().map(of_source).collect()
}

/// Derivative with respect to a source of a convolution of this stride. It is the convolution of `gradient` with the
/// [transposed filter](transposed_filters) of the source. `gradient` is the derivative with respect to the output before
/// the rectifier, with its border filled.
///
/// # Panics
/// If the sizes do not match.
pub fn input_gradient(transposed: &Filter, stride_x: usize, gradient: &Planes, border: Border) -> Planes {
    let mut result = Planes::zeros(transposed.shape.out_channels, gradient.height(), gradient.width() * stride_x);
    if stride_x == 1 {
        convolve(transposed, &[gradient], &mut result);
    } else {
        let mut spread = spread_columns(gradient, stride_x);
        spread.fill_border(border);
        convolve(transposed, &[&spread], &mut result);
    }
    result
}

/// Inserts zeros for the columns that a stride skipped.
fn spread_columns(gradient: &Planes, stride: usize) -> Planes {
    let mut spread = Planes::zeros(gradient.channels(), gradient.height(), gradient.width() * stride);
    for block in 0..blocks(gradient.channels()) {
        for y in 0..gradient.height() {
            let targets = spread.row_mut(block, y).iter_mut().step_by(stride);
            targets.zip(gradient.row(block, y)).for_each(|(target, pixel)| *target = *pixel);
        }
    }
    spread
}
