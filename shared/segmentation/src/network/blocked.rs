//! A network on the kernels of [`kernels::images`]: images are tensors in blocks, reused between runs.

use super::executor::Executor;
use super::layer::Layer;
use crate::SegmentationError;
use candle_core::Tensor;
use kernels::images::ops::{Convolution, MaxPool, Upsample};
use kernels::images::tensors::{Write, size_of_image, tensor_shape, zeros};
use kernels::images::{Border, Filter, LANES, PlanesMut};
use std::ops::Deref;
use std::sync::{Mutex, PoisonError};

/// Images that are reused between runs, because clearing new memory takes a tenth of a run.
#[derive(Debug, Default)]
pub struct ImagePool(Mutex<Vec<Tensor>>);

/// The tensor of an image, which may return to a pool when dropped. A clone of the tensor does not keep its values, a
/// `copy()` does.
pub struct PooledImage<'a> {
    tensor: Tensor,
    pool: Option<&'a ImagePool>,
}

impl ImagePool {
    /// An image of this size: zeros above and below, arbitrary values elsewhere.
    pub(super) fn image(
        &self,
        channels: usize,
        height: usize,
        width: usize,
    ) -> Result<PooledImage<'_>, SegmentationError> {
        let shape = tensor_shape(channels, height, width);
        let mut images = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = images.iter().position(|image| image.dims() == shape).map(|index| images.swap_remove(index));
        drop(images);
        let tensor = found.map_or_else(|| zeros(channels, height, width), Ok)?;
        Ok(PooledImage { tensor, pool: Some(self) })
    }
    /// An image that `write` fills except for its border.
    pub(super) fn written(
        &self,
        [channels, height, width]: [usize; 3],
        border: Border,
        write: impl Fn(&mut PlanesMut<'_>),
    ) -> Result<PooledImage<'_>, SegmentationError> {
        let image = self.image(channels, height, width)?;
        image.inplace_op1(&Write { channels, border, write })?;
        Ok(image)
    }
}

impl From<Tensor> for PooledImage<'_> {
    fn from(tensor: Tensor) -> Self {
        Self { tensor, pool: None }
    }
}

impl Deref for PooledImage<'_> {
    type Target = Tensor;
    fn deref(&self) -> &Tensor {
        &self.tensor
    }
}

impl Drop for PooledImage<'_> {
    fn drop(&mut self) {
        if let Some(pool) = self.pool {
            pool.0.lock().unwrap_or_else(PoisonError::into_inner).push(self.tensor.clone());
        }
    }
}

/// One run through the layers.
pub(super) struct Run<'a> {
    pub(super) filters: std::slice::Iter<'a, Filter>,
    pub(super) border: Border,
    pub(super) pool: &'a ImagePool,
}

impl<'a> Executor for Run<'a> {
    type Image = PooledImage<'a>;

    fn convolution(&mut self, _: &Layer, sources: &[&PooledImage<'a>]) -> Result<PooledImage<'a>, SegmentationError> {
        let filter = self.filters.next().expect("one filter for each layer");
        let [height, width] = size_of_image(sources[0])?;
        let out = self.pool.image(filter.shape.out_channels, height, filter.shape.out_width(width))?;
        let convolution = Convolution { filter, border: self.border };
        match sources {
            [source] => out.inplace_op2(source, &convolution)?,
            [first, second] => out.inplace_op3(first, second, &convolution)?,
            _ => {
                let found = sources.len();
                return Err(candle_core::Error::Msg(format!("a layer of {found} sources; it has one or two")).into());
            }
        }
        Ok(out)
    }
    fn max_pool(&mut self, image: &PooledImage<'a>, factor: [usize; 2]) -> Result<PooledImage<'a>, SegmentationError> {
        let [height, width] = size_of_image(image)?;
        let out = self.pool.image(image.dims()[0] * LANES, height / factor[0], width / factor[1])?;
        out.inplace_op2(image, &MaxPool { factor, border: self.border })?;
        Ok(out)
    }
    fn upsample(&mut self, image: &PooledImage<'a>, factor: [usize; 2]) -> Result<PooledImage<'a>, SegmentationError> {
        let [height, width] = size_of_image(image)?;
        let out = self.pool.image(image.dims()[0] * LANES, height * factor[0], width * factor[1])?;
        out.inplace_op2(image, &Upsample { factor, border: self.border })?;
        Ok(out)
    }
    fn dropout(&mut self, image: PooledImage<'a>, _: f32) -> Result<PooledImage<'a>, SegmentationError> {
        Ok(image)
    }
}
