//! A network on the operations of candle: on any device, with tensors in the order of `PyTorch`, `[batch, channels, rows, columns]`.

use super::{Executor, Layer};
use crate::SegmentationError;
use crate::engine::{Border, Filter, Shape};
use candle_core::{Device, Result, Tensor};

/// Weights and biases of a layer on a device.
#[derive(Debug)]
pub(super) struct DeviceFilter {
    shape: Shape,
    weights: Tensor,
    /// With one row and one column.
    biases: Tensor,
}

impl DeviceFilter {
    pub(super) fn new(filter: &Filter, device: &Device) -> Result<Self> {
        let shape = filter.shape.clone();
        let (weights, biases) = filter.unpacked();
        let [rows, columns] = shape.kernel;
        let weights = Tensor::from_vec(weights, (shape.out_channels, (), rows, columns), device)?;
        let biases = Tensor::from_vec(biases, (1, shape.out_channels, 1, 1), device)?;
        Ok(Self { shape, weights, biases })
    }
    /// candle has one stride for rows and columns: with stride 2 along the columns, every second column is computed in vain.
    fn apply(&self, sources: &[&Tensor], border: Border) -> Result<Tensor> {
        let image = Tensor::cat(sources, 1)?;
        let [rows, columns] = self.shape.kernel;
        let padded = pad_columns(&image, columns / 2, border)?.pad_with_zeros(2, rows / 2, rows / 2)?;
        let sums = padded.conv2d(&self.weights, 0, 1, 1, 1)?;
        let (n, channels, height, width) = sums.dims4()?;
        let stride = self.shape.stride_x;
        let sums = sums.reshape((n, channels, height, width / stride, stride))?.narrow(4, 0, 1)?.squeeze(4)?;
        let out = sums.broadcast_add(&self.biases)?;
        if self.shape.rectify { out.relu() } else { Ok(out) }
    }
}

/// Adds columns on the left and on the right.
fn pad_columns(image: &Tensor, n: usize, border: Border) -> Result<Tensor> {
    if n == 0 || border == Border::Zero {
        return image.pad_with_zeros(3, n, n);
    }
    let width = image.dim(3)?;
    let (left, right) = (image.narrow(3, width.saturating_sub(n), n)?, image.narrow(3, 0, n)?);
    Tensor::cat(&[&left, image, &right], 3)
}

/// One run through the layers.
pub(super) struct Run<'a> {
    pub(super) filters: std::slice::Iter<'a, DeviceFilter>,
    pub(super) border: Border,
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
        Ok(image.max_pool2d((rows, columns))?)
    }
    fn upsample(
        &mut self,
        image: &Tensor,
        [rows, columns]: [usize; 2],
    ) -> std::result::Result<Tensor, SegmentationError> {
        let (_, _, height, width) = image.dims4()?;
        Ok(image.upsample_nearest2d(height * rows, width * columns)?)
    }
    fn dropout(&mut self, image: Tensor, _: f32) -> std::result::Result<Tensor, SegmentationError> {
        Ok(image)
    }
}
