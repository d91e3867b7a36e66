//! Images as tensors of candle: the memory of [`Planes`] with the shape blocks, rows, columns, lanes, borders included.

use super::planes::{BORDER, Border, LANES, Planes, PlanesMut, PlanesRef, blocks};
use candle_core::{CpuStorage, CustomOp1, DType, Device, InplaceOp1, Layout, Result, Shape, Storage, Tensor, bail};

/// Shape of the tensor of an image.
pub fn tensor_shape(channels: usize, height: usize, width: usize) -> [usize; 4] {
    [blocks(channels), height + 2 * BORDER, width + 2 * BORDER, LANES]
}

/// Rows and columns of the image in a tensor, without the border.
///
/// # Errors
/// If the tensor is not an image.
pub fn size_of_image(image: &Tensor) -> Result<[usize; 2]> {
    size(image.layout())
}

fn size(layout: &Layout) -> Result<[usize; 2]> {
    match layout.dims() {
        &[_, rows, columns, LANES] if rows >= 2 * BORDER && columns >= 2 * BORDER => {
            Ok([rows - 2 * BORDER, columns - 2 * BORDER])
        }
        dims => bail!("tensor of shape {dims:?}; an image has blocks, rows, columns, and {LANES} lanes"),
    }
}

/// Rows, columns and range of memory of an image with this number of channels.
fn place(layout: &Layout, channels: usize) -> Result<([usize; 2], std::ops::Range<usize>)> {
    let [height, width] = size(layout)?;
    match layout.contiguous_offsets() {
        _ if layout.dims()[0] != blocks(channels) => {
            bail!("an image of {} blocks; {channels} channels need {}", layout.dims()[0], blocks(channels))
        }
        Some((start, end)) => Ok(([height, width], start..end)),
        None => bail!("an image must be contiguous; call contiguous() first"),
    }
}

/// The image in the memory of a tensor.
pub(super) fn planes_of<'a>(storage: &'a CpuStorage, layout: &Layout, channels: usize) -> Result<PlanesRef<'a>> {
    let ([height, width], range) = place(layout, channels)?;
    let pixels = storage.as_slice::<f32>()?[range].as_chunks().0;
    Ok(Planes::from_pixels(channels, height, width, pixels))
}

/// The image in the memory of a tensor, mutably borrowed.
pub(super) fn planes_mut_of<'a>(
    storage: &'a mut CpuStorage,
    layout: &Layout,
    channels: usize,
) -> Result<PlanesMut<'a>> {
    let ([height, width], range) = place(layout, channels)?;
    let CpuStorage::F32(values) = storage else { bail!("an image must have values of type F32") };
    let pixels = values[range].as_chunks_mut().0;
    Ok(Planes::from_pixels(channels, height, width, pixels))
}

/// Reads an image with this number of channels in a tensor on the CPU.
///
/// # Errors
/// If the tensor is not an image of this number of channels on the CPU.
pub fn read_image<R>(image: &Tensor, channels: usize, read: impl FnOnce(PlanesRef<'_>) -> R) -> Result<R> {
    match &*image.storage_and_layout().0 {
        Storage::Cpu(storage) => Ok(read(planes_of(storage, image.layout(), channels)?)),
        _ => bail!("an image must be in the memory of the CPU"),
    }
}

impl Planes {
    /// A tensor with a copy of the image.
    ///
    /// # Errors
    /// If candle fails.
    pub fn to_tensor(&self) -> Result<Tensor> {
        Tensor::from_slice(self.values(), &tensor_shape(self.channels(), self.height(), self.width()), &Device::Cpu)
    }
    /// A copy of the image in a tensor.
    ///
    /// # Errors
    /// If the tensor is not an image of this number of channels on the CPU.
    pub fn from_tensor(image: &Tensor, channels: usize) -> Result<Self> {
        read_image(image, channels, |planes| planes.copied())
    }
}

/// Writes an image in place: `write` writes everything except the border.
pub struct Write<F> {
    /// Channels of the image.
    pub channels: usize,
    /// The border.
    pub border: Border,
    /// Writes the pixels.
    pub write: F,
}

impl<F: Fn(&mut PlanesMut<'_>)> InplaceOp1 for Write<F> {
    fn name(&self) -> &'static str {
        "write_image"
    }
    fn cpu_fwd(&self, image: &mut CpuStorage, layout: &Layout) -> Result<()> {
        let mut image = planes_mut_of(image, layout, self.channels)?;
        written(&mut image, self.border, |image| (self.write)(image))
    }
}

/// Calls `write` for everything except the border, then fills the border.
pub(super) fn written(image: &mut PlanesMut<'_>, border: Border, write: impl FnOnce(&mut PlanesMut<'_>)) -> Result<()> {
    if border == Border::Circular && image.width() < BORDER {
        bail!("a circular image of {} columns; it must have at least {BORDER}", image.width());
    }
    write(image);
    image.fill_border(border);
    Ok(())
}

/// Converts from blocks to the order of `PyTorch`, `[1, channels, rows, columns]`.
pub struct FromBlocks {
    /// Channels of the image.
    pub channels: usize,
}

impl CustomOp1 for FromBlocks {
    fn name(&self) -> &'static str {
        "from_blocks"
    }
    fn cpu_fwd(&self, image: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let image = planes_of(image, layout, self.channels)?;
        Ok((CpuStorage::F32(image.to_channels_first()), Shape::from((1, self.channels, image.height(), image.width()))))
    }
}

/// Converts from the order of `PyTorch`, `[1, channels, rows, columns]`, to blocks.
pub struct ToBlocks {
    /// The border.
    pub border: Border,
}

impl CustomOp1 for ToBlocks {
    fn name(&self) -> &'static str {
        "to_blocks"
    }
    fn cpu_fwd(&self, values: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (&[1, channels, height, width], Some((start, end))) = (layout.dims(), layout.contiguous_offsets()) else {
            bail!("tensor of shape {:?}; expected [1, channels, rows, columns], contiguous", layout.dims());
        };
        let values = &values.as_slice::<f32>()?[start..end];
        let shape = tensor_shape(channels, height, width);
        let mut blocked = vec![0.0; shape.iter().product()];
        let mut image: PlanesMut<'_> = Planes::from_pixels(channels, height, width, blocked.as_chunks_mut().0);
        written(&mut image, self.border, |image| image.write_channels_first(values))?;
        Ok((CpuStorage::F32(blocked), Shape::from(shape.to_vec())))
    }
}

/// A tensor of zeros with the shape of an image.
///
/// # Errors
/// If candle fails.
pub fn zeros(channels: usize, height: usize, width: usize) -> Result<Tensor> {
    Tensor::zeros(&tensor_shape(channels, height, width), DType::F32, &Device::Cpu)
}
