//! Tensors as pixels of 16 channels and back.

use crate::engine::{Border, Feature, LANES, Planes};
use candle_core::{CpuStorage, Layout, Result, Shape, Storage, Tensor, bail};

/// The numbers of a tensor of an operation.
pub(super) fn numbers<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let Some((start, end)) = layout.contiguous_offsets() else { bail!("expected a contiguous tensor") };
    Ok(&storage.as_slice::<f32>()?[start..end])
}

/// Runs `f` on the numbers of a tensor.
pub(super) fn with_numbers<R>(tensor: &Tensor, f: impl FnOnce(&[f32]) -> Result<R>) -> Result<R> {
    let tensor = tensor.contiguous()?;
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => f(numbers(storage, layout)?),
        _ => bail!("expected a tensor on the CPU"),
    }
}

/// As rows of 16.
pub(super) fn features(numbers: &[f32]) -> &[Feature] {
    numbers.as_chunks::<LANES>().0
}

pub(super) fn storage(pixels: Vec<Feature>) -> CpuStorage {
    CpuStorage::F32(pixels.into_flattened())
}

/// Batch, blocks, rows and columns of an image tensor.
pub(super) fn image_dims(shape: &Shape) -> Result<[usize; 4]> {
    match shape.dims() {
        &[n, blocks, height, width, LANES] => Ok([n, blocks, height, width]),
        got => bail!("expected an image of batch, blocks, rows, columns and 16 channels, got {got:?}"),
    }
}

/// One image of a batch.
pub(super) fn planes(pixels: &[Feature], dims: [usize; 4], channels: usize, index: usize, border: Border) -> Planes {
    let [_, blocks, height, width] = dims;
    let len = blocks * height * width;
    Planes::from_inner(channels, height, width, &pixels[index * len..][..len], border)
}

/// One row of channels for every pixel: batch, rows and columns in one dimension, the first `channels` channels in the other.
///
/// # Errors
/// If it is no image tensor.
pub fn rows_from_image(image: &Tensor, channels: usize) -> Result<Tensor> {
    let [n, blocks, height, width] = image_dims(image.shape())?;
    image.permute((0, 2, 3, 1, 4))?.reshape((n * height * width, blocks * LANES))?.narrow(1, 0, channels)
}

/// The image whose pixels are the rows of a matrix, channels filled up with zeros; the inverse of [`rows_from_image`].
///
/// # Errors
/// If there are not batch x height x width rows.
pub fn image_from_rows(rows: &Tensor, [n, height, width]: [usize; 3]) -> Result<Tensor> {
    let channels = rows.dim(1)?;
    let blocks = channels.div_ceil(LANES);
    let filled = rows.pad_with_zeros(1, 0, blocks * LANES - channels)?;
    filled.reshape((n, height, width, blocks, LANES))?.permute((0, 3, 1, 2, 4))?.contiguous()
}
