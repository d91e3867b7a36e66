//! Convolutions over taps: the weighted inputs of some rows are collected, then multiplied with the weights of all taps at once.
//! Memory is bounded: no tensor of all rows x taps exists.

use super::activation::Activation;
use super::linear::{row_sum, sum_parts};
use super::product::{Matrix, Packed};
use super::rows::{read, tensor, values};
use super::taps::{KernelPoints, KernelTaps, Neighborhood, Taps};
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor, bail};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::sync::Arc;

/// Values of a block of rows x taps x channels: half a second-level cache.
const BLOCK_VALUES: usize = 1 << 16;
/// Parts of the gradient of the weights.
const PARTS: usize = 8;

/// Number of rows that are collected at once.
fn block_rows(depth: usize) -> usize {
    (BLOCK_VALUES / depth.max(1)).clamp(8, 128)
}

/// `activation(collected rows x right + bias)`.
pub(super) fn convolve(
    taps: &impl Taps,
    input: &[f32],
    n_columns: usize,
    right: &Packed,
    bias: Option<&[f32]>,
    activation: Activation,
) -> Vec<f32> {
    let n_out = right.n_columns();
    let depth = taps.n_taps() * n_columns;
    let mut out = vec![0.0; taps.n_rows() * n_out];
    if n_out == 0 {
        return out;
    }
    let block = block_rows(depth);
    out.par_chunks_mut(block * n_out).enumerate().for_each_init(
        || vec![0.0; block * depth],
        |collected, (block_idx, out)| {
            if let Some(bias) = bias {
                out.chunks_exact_mut(n_out).for_each(|row| row.copy_from_slice(bias));
            }
            let n_rows = out.len() / n_out;
            collect(taps, input, n_columns, block_idx * block, &mut collected[..n_rows * depth]);
            right.add_product(Matrix::from_rows(collected, depth), out);
            activation.apply(out);
        },
    );
    out
}

/// Collects the inputs of rows starting at `first`.
fn collect(taps: &impl Taps, input: &[f32], n_columns: usize, first: usize, collected: &mut [f32]) {
    collected.fill(0.0);
    if taps.n_taps() * n_columns > 0 {
        pulp::Arch::new().dispatch(Collect { taps, input, n_columns, first, collected });
    }
}

struct Collect<'a, T> {
    taps: &'a T,
    input: &'a [f32],
    n_columns: usize,
    first: usize,
    collected: &'a mut [f32],
}

impl<T: Taps> WithSimd for Collect<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let rows = self.collected.chunks_exact_mut(self.taps.n_taps() * self.n_columns);
        for (row, collected) in rows.enumerate() {
            self.taps.add(simd, self.first + row, self.input, self.n_columns, collected);
        }
    }
}

/// The gradient of the weights, `(taps x columns, out)`.
pub(super) fn weight_gradient(
    taps: &impl Taps,
    input: &[f32],
    n_columns: usize,
    gradient: &[f32],
    n_out: usize,
) -> Vec<f32> {
    let n = taps.n_rows();
    let depth = taps.n_taps() * n_columns;
    let block = block_rows(depth);
    let part = n.div_ceil(PARTS).next_multiple_of(block);
    let of_part = |start: usize| {
        let mut out = vec![0.0; depth * n_out];
        let mut collected = vec![0.0; block * depth];
        let mut right = Packed::new(Matrix::from_rows(&[], n_out), 0, n_out);
        for first in (start..(start + part).min(n)).step_by(block) {
            let rows = block.min(n - first);
            collect(taps, input, n_columns, first, &mut collected[..rows * depth]);
            right.pack(Matrix::from_rows(&gradient[first * n_out..], n_out), rows, n_out);
            right.add_product(Matrix::from_rows(&collected, depth).transposed(), &mut out);
        }
        out
    };
    sum_parts((0..n).step_by(part.max(1)).collect::<Vec<_>>().into_par_iter().map(of_part), depth * n_out)
}

/// Kernel point convolution (Thomas et al., ICCV 2019), rigid, followed by an activation: the sum over neighbors and kernel points of
/// influence x features x weights. Features `(support, in)`, weights `(kernel points, in, out)`, bias `(out)`.
pub fn kernel_point_convolution(
    features: &Tensor,
    weights: &Tensor,
    bias: &Tensor,
    at: &Neighborhood,
    kernel: &KernelPoints,
    activation: Activation,
) -> Result<Tensor> {
    if at.queries.len() != at.lists.len() || at.support.len() != at.lists.n_rows() {
        bail!("kernel point convolution: lists of {} x {}", at.lists.len(), at.lists.n_rows());
    }
    let op = KernelPointConvolution { at: at.clone(), kernel: Arc::new(kernel.clone()), activation };
    features.contiguous()?.apply_op3(&weights.contiguous()?, &bias.contiguous()?, op)
}

struct KernelPointConvolution {
    at: Neighborhood,
    kernel: Arc<KernelPoints>,
    activation: Activation,
}

impl CustomOp3 for KernelPointConvolution {
    fn name(&self) -> &'static str {
        "kernel-point-convolution"
    }
    fn cpu_fwd(
        &self,
        features: &CpuStorage,
        features_layout: &Layout,
        weights: &CpuStorage,
        weights_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (n, n_in) = features_layout.shape().dims2()?;
        let (n_points, of_weights, n_out) = weights_layout.shape().dims3()?;
        if n != self.at.support.len()
            || of_weights != n_in
            || n_points != self.kernel.len()
            || bias_layout.dims() != [n_out]
        {
            bail!(
                "kernel point convolution: features {:?}, weights {:?}, {} support points, {} kernel points",
                (n, n_in),
                (n_points, of_weights, n_out),
                self.at.support.len(),
                self.kernel.len()
            );
        }
        let features = values(features, features_layout)?;
        let weights = values(weights, weights_layout)?;
        let right = Packed::new(Matrix::from_rows(weights, n_out), n_points * n_in, n_out);
        let taps = KernelTaps::forward(&self.at, &self.kernel);
        let bias = Some(values(bias, bias_layout)?);
        let out = convolve(&taps, features, n_in, &right, bias, self.activation);
        Ok((CpuStorage::F32(out), (taps.n_rows(), n_out).into()))
    }
    fn bwd(
        &self,
        features: &Tensor,
        weights: &Tensor,
        bias: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let gradient = self.activation.gradient(result, gradient)?;
        let (n_points, n_in, n_out) = weights.dims3()?;
        // A support point reads the gradients of its queries through the same kernel, with the weights of each tap transposed.
        let of_features = || {
            let exchanged = weights.transpose(1, 2)?;
            let right = read(&exchanged, |w| Packed::new(Matrix::from_rows(w, n_in), n_points * n_out, n_in))?;
            let taps = KernelTaps::backward(&self.at, &self.kernel);
            let out = read(&gradient, |gradient| convolve(&taps, gradient, n_out, &right, None, Activation::NONE))?;
            tensor(out, features.shape().clone())
        };
        let of_weights = || {
            let taps = KernelTaps::forward(&self.at, &self.kernel);
            let sums = |features: &[f32], gradient: &[f32]| weight_gradient(&taps, features, n_in, gradient, n_out);
            tensor(read(features, |f| read(&gradient, |g| sums(f, g)))??, weights.shape().clone())
        };
        Ok((
            features.track_op().then(of_features).transpose()?,
            weights.track_op().then(of_weights).transpose()?,
            bias.track_op().then(|| row_sum(&gradient)).transpose()?,
        ))
    }
}
