//! 3 x 3 convolutions of stride 1 on planes with zeros around them. A row is a cell; the cells of a plane are in row-major order.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::activation::Activation;
use super::linear::row_sum;
use super::product::{Matrix, Packed};
use super::rows::{for_each_block, read, tensor, values};
use super::tap_convolution::{convolve, weight_gradient};
use super::taps::Taps;
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor, bail};
use pulp::Simd;
use rayon::prelude::*;

/// Taps of a 3 x 3 kernel.
const TAPS: usize = 9;
/// Channels that a depth-wise convolution sums at a time.
const CHANNELS: usize = 16;
/// Rows of cells of a part of the gradient of the weights.
const PART_ROWS: usize = 16;

/// Planes of equal size, one after another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneShape {
    /// Number of planes.
    pub planes: usize,
    /// Rows of cells of a plane.
    pub height: usize,
    /// Cells of a row.
    pub width: usize,
}

impl PlaneShape {
    /// Number of cells of all planes.
    pub fn n_cells(self) -> usize {
        self.planes * self.height * self.width
    }
    /// Calls `visit` with each tap of the kernel at cell `x` of a row of cells, and the cell under it.
    #[inline(always)]
    fn for_each_tap(self, row_start: usize, x: usize, mut visit: impl FnMut(usize, usize)) {
        let y = row_start / self.width % self.height;
        for dy in 0..3 {
            if (1..=self.height).contains(&(y + dy)) {
                for dx in 0..3 {
                    if (1..=self.width).contains(&(x + dx)) {
                        visit(3 * dy + dx, row_start + x + dy * self.width + dx - self.width - 1);
                    }
                }
            }
        }
    }
}

impl Taps for PlaneShape {
    fn n_rows(&self) -> usize {
        self.n_cells()
    }
    fn n_taps(&self) -> usize {
        TAPS
    }
    #[inline(always)]
    fn add<S: Simd>(&self, _: S, row: usize, input: &[f32], n_columns: usize, out: &mut [f32]) {
        let x = row % self.width;
        self.for_each_tap(
            row - x,
            x,
            #[inline(always)]
            |tap, cell| {
                let input = &input[cell * n_columns..(cell + 1) * n_columns];
                out[tap * n_columns..(tap + 1) * n_columns].copy_from_slice(input);
            },
        );
    }
}

/// Convolution of all channels. Cells `(cells, in)`, weight `(out, in, 3, 3)`, bias `(out)`.
pub fn plane_convolution(
    cells: &Tensor,
    weight: &Tensor,
    bias: &Tensor,
    shape: PlaneShape,
    activation: Activation,
) -> Result<Tensor> {
    cells.contiguous()?.apply_op3(&weight.contiguous()?, &bias.contiguous()?, Dense { shape, activation })
}

/// Separate convolution of each channel. Cells `(cells, channels)`, weight `(channels, 1, 3, 3)`, bias `(channels)`.
pub fn depth_wise_convolution(
    cells: &Tensor,
    weight: &Tensor,
    bias: &Tensor,
    shape: PlaneShape,
    activation: Activation,
) -> Result<Tensor> {
    cells.contiguous()?.apply_op3(&weight.contiguous()?, &bias.contiguous()?, DepthWise { shape, activation })
}

/// Channels of a convolution.
struct Channels {
    inputs: usize,
    outputs: usize,
}

fn check(shape: PlaneShape, cells: &Layout, weight: &Layout, bias: &Layout, groups: bool) -> Result<Channels> {
    let ((n, n_in), (n_out, of_weight, 3, 3)) = (cells.shape().dims2()?, weight.shape().dims4()?) else {
        bail!("plane convolution: weight {:?}, expected 3 x 3", weight.shape());
    };
    let fits = if groups { of_weight == 1 && n_out == n_in } else { of_weight == n_in };
    if n != shape.n_cells() || !fits || bias.dims() != [n_out] {
        bail!(
            "plane convolution: cells {:?} of {shape:?}, weight {:?}, bias {:?}",
            cells.shape(),
            weight.shape(),
            bias.shape()
        );
    }
    Ok(Channels { inputs: n_in, outputs: n_out })
}

struct Dense {
    shape: PlaneShape,
    activation: Activation,
}

impl CustomOp3 for Dense {
    fn name(&self) -> &'static str {
        "plane-convolution"
    }
    fn cpu_fwd(
        &self,
        cells: &CpuStorage,
        cells_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let Channels { inputs: n_in, outputs: n_out } =
            check(self.shape, cells_layout, weight_layout, bias_layout, false)?;
        let cells = values(cells, cells_layout)?;
        let weight = values(weight, weight_layout)?;
        let by_tap = |i: usize| weight[(i % n_out * n_in + i / n_out % n_in) * TAPS + i / n_out / n_in];
        let by_tap: Vec<f32> = (0..weight.len()).map(by_tap).collect();
        let right = Packed::new(Matrix::from_rows(&by_tap, n_out), TAPS * n_in, n_out);
        let bias = Some(values(bias, bias_layout)?);
        let out = convolve(&self.shape, cells, n_in, &right, bias, self.activation);
        Ok((CpuStorage::F32(out), (self.shape.n_cells(), n_out).into()))
    }
    fn bwd(
        &self,
        cells: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let gradient = self.activation.gradient(result, gradient)?;
        let (n_out, n_in, _, _) = weight.dims4()?;
        let of_cells = || {
            // The taps, rotated by 180 degrees.
            let by_tap = |weight: &[f32]| {
                let at = |i: usize| weight[(i / n_in % n_out * n_in + i % n_in) * TAPS + TAPS - 1 - i / n_in / n_out];
                let by_tap: Vec<f32> = (0..weight.len()).map(at).collect();
                Packed::new(Matrix::from_rows(&by_tap, n_in), TAPS * n_out, n_in)
            };
            let right = read(weight, by_tap)?;
            let out = read(&gradient, |g| convolve(&self.shape, g, n_out, &right, None, Activation::NONE))?;
            tensor(out, cells.shape().clone())
        };
        let of_weight = || {
            let sums = |cells: &[f32], gradient: &[f32]| weight_gradient(&self.shape, cells, n_in, gradient, n_out);
            let by_tap = read(cells, |cells| read(&gradient, |gradient| sums(cells, gradient)))??;
            let at = |i: usize| by_tap[(i % TAPS * n_in + i / TAPS % n_in) * n_out + i / TAPS / n_in];
            tensor((0..by_tap.len()).map(at).collect(), weight.shape().clone())
        };
        Ok((
            cells.track_op().then(of_cells).transpose()?,
            weight.track_op().then(of_weight).transpose()?,
            bias.track_op().then(|| row_sum(&gradient)).transpose()?,
        ))
    }
}

struct DepthWise {
    shape: PlaneShape,
    activation: Activation,
}

impl CustomOp3 for DepthWise {
    fn name(&self) -> &'static str {
        "depth-wise-plane-convolution"
    }
    fn cpu_fwd(
        &self,
        cells: &CpuStorage,
        cells_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let n_channels = check(self.shape, cells_layout, weight_layout, bias_layout, true)?.inputs;
        let cells = values(cells, cells_layout)?;
        let weight = values(weight, weight_layout)?;
        let by_tap = weight_by_tap(weight, n_channels, false);
        let bias = Some(values(bias, bias_layout)?);
        let out = depth_wise(self.shape, cells, n_channels, &by_tap, bias, self.activation);
        Ok((CpuStorage::F32(out), (self.shape.n_cells(), n_channels).into()))
    }
    fn bwd(
        &self,
        cells: &Tensor,
        weight: &Tensor,
        bias: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let gradient = self.activation.gradient(result, gradient)?;
        let n_channels = weight.dim(0)?;
        let of_cells = || {
            let by_tap = read(weight, |weight| weight_by_tap(weight, n_channels, true))?;
            let out = read(&gradient, |g| depth_wise(self.shape, g, n_channels, &by_tap, None, Activation::NONE))?;
            tensor(out, cells.shape().clone())
        };
        let of_weight = || {
            let sums =
                |cells: &[f32], gradient: &[f32]| depth_wise_weight_gradient(self.shape, cells, gradient, n_channels);
            let by_tap = read(cells, |cells| read(&gradient, |gradient| sums(cells, gradient)))??;
            let at = |i: usize| by_tap[i % TAPS * n_channels + i / TAPS] as f32;
            tensor((0..by_tap.len()).map(at).collect(), weight.shape().clone())
        };
        Ok((
            cells.track_op().then(of_cells).transpose()?,
            weight.track_op().then(of_weight).transpose()?,
            bias.track_op().then(|| row_sum(&gradient)).transpose()?,
        ))
    }
}

/// The weights `(channels, 3, 3)` by tap, rotated by 180 degrees if `turned`.
fn weight_by_tap(weight: &[f32], n_channels: usize, turned: bool) -> Vec<f32> {
    let at = |i: usize| {
        let tap = if turned { TAPS - 1 - i / n_channels } else { i / n_channels };
        weight[i % n_channels * TAPS + tap]
    };
    (0..weight.len()).map(at).collect()
}

fn depth_wise(
    shape: PlaneShape,
    cells: &[f32],
    n_channels: usize,
    by_tap: &[f32],
    bias: Option<&[f32]>,
    activation: Activation,
) -> Vec<f32> {
    let mut out = vec![0.0; shape.n_cells() * n_channels];
    for_each_block(&mut out, n_channels, shape.width, |first, out| {
        wide_loops::run(
            #[inline(always)]
            || {
                for (cell, out) in out.chunks_exact_mut(n_channels).enumerate() {
                    let start = bias.unwrap_or(&[]);
                    let mut channel = 0;
                    while channel + CHANNELS <= n_channels {
                        // Sums in registers.
                        let mut sums = [0.0; CHANNELS];
                        if let Some(start) = start.get(channel..channel + CHANNELS) {
                            sums.copy_from_slice(start);
                        }
                        shape.for_each_tap(
                            first,
                            cell,
                            #[inline(always)]
                            |tap, other| {
                                let weights = &by_tap[tap * n_channels + channel..][..CHANNELS];
                                let other = &cells[other * n_channels + channel..][..CHANNELS];
                                for c in 0..CHANNELS {
                                    sums[c] += weights[c] * other[c];
                                }
                            },
                        );
                        out[channel..channel + CHANNELS].copy_from_slice(&sums);
                        channel += CHANNELS;
                    }
                    for c in channel..n_channels {
                        let mut sum = start.get(c).copied().unwrap_or(0.0);
                        shape.for_each_tap(
                            first,
                            cell,
                            #[inline(always)]
                            |tap, other| sum += by_tap[tap * n_channels + c] * cells[other * n_channels + c],
                        );
                        out[c] = sum;
                    }
                }
            },
        );
        activation.apply(out);
    });
    out
}

/// The gradient of the weights by tap: parts of some rows of cells in `f32`, added in order in `f64`.
fn depth_wise_weight_gradient(shape: PlaneShape, cells: &[f32], gradient: &[f32], n_channels: usize) -> Vec<f64> {
    let n_rows = shape.planes * shape.height;
    let of_part = |part: usize| {
        let mut sums = vec![0.0_f32; TAPS * n_channels];
        wide_loops::run(
            #[inline(always)]
            || {
                for row in part * PART_ROWS..((part + 1) * PART_ROWS).min(n_rows) {
                    for x in 0..shape.width {
                        let start = (row * shape.width + x) * n_channels;
                        let gradient = &gradient[start..start + n_channels];
                        shape.for_each_tap(
                            row * shape.width,
                            x,
                            #[inline(always)]
                            |tap, other| {
                                let sums = &mut sums[tap * n_channels..(tap + 1) * n_channels];
                                let other = &cells[other * n_channels..(other + 1) * n_channels];
                                for c in 0..n_channels {
                                    sums[c] += gradient[c] * other[c];
                                }
                            },
                        );
                    }
                }
            },
        );
        sums
    };
    let parts: Vec<Vec<f32>> = (0..n_rows.div_ceil(PART_ROWS)).into_par_iter().map(of_part).collect();
    let mut total = vec![0.0; TAPS * n_channels];
    for part in parts {
        total.iter_mut().zip(part).for_each(|(total, part)| *total += f64::from(part));
    }
    total
}
