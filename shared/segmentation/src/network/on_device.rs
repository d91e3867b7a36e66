//! A network on the operations of candle: on any device, and with derivatives. The crate `training` runs it on
//! variables. Images of a batch are tensors `[channels, images, rows, columns]`: with the channels first, a convolution
//! is one matrix product.
//!
//! candle's own convolution, pooling and upsampling are not used: on a GPU (0.9.2), the derivative of a convolution
//! reads its transposed factor as if it were contiguous; the derivative of a maximum over four pixels is a quarter of
//! the correct one.

use super::executor::Executor;
use super::layer::Layer;
use crate::SegmentationError;
use candle_core::{Device, Result, Tensor};
use kernels::images::tensors::FromBlocks;
use kernels::images::{Border, Filter, PlainFilter, Shape};
use random::Random;
use rayon::prelude::*;

/// Images of [`kernels::images`] of one size as a tensor on a device, `[channels, images, rows, columns]`.
///
/// # Errors
/// If the images are of several sizes, or not on the CPU.
pub fn batch(images: &[&Tensor], channels: usize, device: &Device) -> Result<Tensor> {
    let from_blocks = |image: &&Tensor| image.apply_op1_no_bwd(&FromBlocks { channels });
    let images = images.par_iter().map(from_blocks).collect::<Result<Vec<_>>>()?;
    let on_device = |image: Tensor| image.to_device(device)?.transpose(0, 1)?.contiguous();
    Tensor::cat(&images.into_iter().map(on_device).collect::<Result<Vec<_>>>()?, 1)
}

/// Weights `[out, in, rows, columns]` and biases `[out]` of a filter.
///
/// # Errors
/// If the device cannot hold them.
pub fn tensors_of(filter: &Filter, device: &Device) -> Result<[Tensor; 2]> {
    let PlainFilter { weights, biases } = filter.unpacked();
    let [rows, columns] = filter.shape.kernel;
    let n_out = filter.shape.out_channels;
    Ok([Tensor::from_vec(weights, (n_out, (), rows, columns), device)?, Tensor::from_vec(biases, n_out, device)?])
}

/// Weights and biases of a layer on a device.
#[derive(Debug)]
pub struct DeviceFilter {
    shape: Shape,
    /// Weights, `[out, columns x rows x in]`, in the order of [`taps`].
    weights: Tensor,
    /// Biases, `[out, 1]`.
    biases: Tensor,
}

impl DeviceFilter {
    /// Copies a filter to a device.
    ///
    /// # Errors
    /// If the device cannot hold it.
    pub fn new(filter: &Filter, device: &Device) -> Result<Self> {
        let [weights, biases] = tensors_of(filter, device)?;
        Self::from_tensors(filter.shape.clone(), &weights, &biases)
    }
    /// Creates a filter from tensors in the form of [`tensors_of`], on one device. The layer changes with them if they
    /// are variables.
    ///
    /// # Errors
    /// If the tensors do not have the shape.
    pub fn from_tensors(shape: Shape, weights: &Tensor, biases: &Tensor) -> Result<Self> {
        let n_out = shape.out_channels;
        let weights = weights.permute((0, 3, 2, 1))?.contiguous()?.reshape((n_out, ()))?;
        Ok(Self { shape, weights, biases: biases.reshape((n_out, 1))? })
    }
    fn apply(&self, sources: &[&Tensor], border: Border) -> Result<Tensor> {
        let image = Tensor::cat(sources, 0)?;
        let (_, n, height, width) = image.dims4()?;
        let taps = taps(&image, &self.shape, border)?;
        let sums = self.weights.matmul(&taps.reshape((self.weights.dim(1)?, ()))?)?;
        let out = sums.broadcast_add(&self.biases)?;
        let out = if self.shape.rectify { out.relu()? } else { out };
        out.reshape((self.shape.out_channels, n, height, width / self.shape.stride_x))
    }
}

/// The input of a filter: its taps as channels, columns outermost, then rows, then the channels of the image.
fn taps(image: &Tensor, shape: &Shape, border: Border) -> Result<Tensor> {
    let (_, _, height, width) = image.dims4()?;
    let [rows, columns] = shape.kernel;
    let shifted = |image: &Tensor, dim: usize, n: usize, length: usize| -> Result<Tensor> {
        let views = (0..n).map(|first| image.narrow(dim, first, length)).collect::<Result<Vec<_>>>()?;
        Tensor::cat(&views, 0)
    };
    let mut taps = image.clone();
    if rows > 1 {
        taps = shifted(&taps.pad_with_zeros(2, rows / 2, rows / 2)?, 2, rows, height)?;
    }
    if columns > 1 {
        taps = shifted(&pad_columns(&taps, columns / 2, border)?, 3, columns, width)?;
    }
    every(&taps, 3, shape.stride_x)
}

/// Adds columns on the left and on the right.
fn pad_columns(image: &Tensor, n: usize, border: Border) -> Result<Tensor> {
    if border == Border::Zero {
        return image.pad_with_zeros(3, n, n);
    }
    let width = image.dim(3)?;
    let side = |first: usize| image.narrow(3, first, n)?.contiguous();
    Tensor::cat(&[&side(width.saturating_sub(n))?, image, &side(0)?], 3)
}

/// Every `n`-th slice along a dimension.
fn every(image: &Tensor, dim: usize, n: usize) -> Result<Tensor> {
    if n == 1 {
        return Ok(image.clone());
    }
    slice_of_windows(image, dim, n, 0)?.contiguous()
}

/// The `at`-th slice of each window of `n` along a dimension.
fn slice_of_windows(image: &Tensor, dim: usize, n: usize, at: usize) -> Result<Tensor> {
    let mut dims = image.dims().to_vec();
    dims[dim] /= n;
    dims.insert(dim + 1, n);
    image.reshape(dims)?.narrow(dim + 1, at, 1)?.squeeze(dim + 1)
}

/// The maximum of each window of `n` along a dimension.
fn maximum(image: &Tensor, dim: usize, n: usize) -> Result<Tensor> {
    let mut largest = every(image, dim, n)?;
    for at in 1..n {
        largest = largest.maximum(&slice_of_windows(image, dim, n, at)?)?;
    }
    Ok(largest)
}

/// One run through the layers.
pub struct Run<'a> {
    /// Filters of the layers that are not applied yet, in order.
    pub filters: std::slice::Iter<'a, DeviceFilter>,
    /// Padding beyond the left and right edge.
    pub border: Border,
    /// Random numbers for dropout; `None` disables dropout.
    pub dropout: Option<&'a mut Random>,
}

impl Executor for Run<'_> {
    type Image = Tensor;

    fn convolution(&mut self, _: &Layer, sources: &[&Tensor]) -> std::result::Result<Tensor, SegmentationError> {
        let filter = self.filters.next().expect("one filter for each layer");
        Ok(filter.apply(sources, self.border)?)
    }
    fn max_pool(
        &mut self,
        image: &Tensor,
        [rows, columns]: [usize; 2],
    ) -> std::result::Result<Tensor, SegmentationError> {
        Ok(maximum(&maximum(image, 3, columns)?, 2, rows)?)
    }
    fn upsample(
        &mut self,
        image: &Tensor,
        [rows, columns]: [usize; 2],
    ) -> std::result::Result<Tensor, SegmentationError> {
        let (channels, n, height, width) = image.dims4()?;
        // A sum over small windows, the derivative of a broadcast, is slow on a GPU; the derivative of a concatenation
        // is not.
        let copies = Tensor::cat(&vec![image; rows * columns], 0)?;
        let copies = copies.reshape((rows, columns, channels * n, height, width))?.permute((2, 3, 0, 4, 1))?;
        Ok(copies.contiguous()?.reshape((channels, n, height * rows, width * columns))?)
    }
    fn dropout(&mut self, image: Tensor, rate: f32) -> std::result::Result<Tensor, SegmentationError> {
        let Some(random) = &mut self.dropout else { return Ok(image) };
        let kept = 1.0 / (1.0 - rate);
        let factors: Vec<f32> = (0..image.elem_count()).map(|_| if random.chance(rate) { 0.0 } else { kept }).collect();
        Ok((&image * Tensor::from_vec(factors, image.shape(), image.device())?)?)
    }
}
