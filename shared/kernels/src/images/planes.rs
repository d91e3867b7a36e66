//! The memory layout of images.

use std::ops::{Deref, DerefMut};

/// Channels per block: one AVX-512 register, two AVX2 registers.
pub const LANES: usize = 16;

/// The 16 channels of a pixel in one block.
pub type Feature = [f32; LANES];

/// Width of the border around an image, px: enough for 5 x 5 filters.
pub const BORDER: usize = 2;

/// Padding beyond the left and right edge. Above and below it is zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// Zeros.
    Zero,
    /// The opposite edge: columns are the angles of a full revolution.
    Circular,
}

/// Number of blocks for a number of channels.
#[inline(always)]
pub const fn blocks(channels: usize) -> usize {
    channels.div_ceil(LANES)
}

/// An image with any number of channels: one plane per 16 channels, rows from top to bottom, with a border around it.
/// Padding channels of the last block are zero. `P` is the memory of the pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes<P = Vec<Feature>> {
    channels: usize,
    height: usize,
    width: usize,
    pixels: P,
}

/// An image that borrows the memory of another one, or of a tensor.
pub type PlanesRef<'a> = Planes<&'a [Feature]>;

/// An image that mutably borrows the memory of another one, or of a tensor.
pub type PlanesMut<'a> = Planes<&'a mut [Feature]>;

/// Number of pixels of an image, with borders.
fn n_pixels(channels: usize, height: usize, width: usize) -> usize {
    blocks(channels) * (height + 2 * BORDER) * (width + 2 * BORDER)
}

impl Planes {
    /// An image of zeros.
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        Self { channels, height, width, pixels: vec![[0.0; LANES]; n_pixels(channels, height, width)] }
    }
    /// An image with the value of `value` for each channel, row and column, called in this order, and a filled border.
    ///
    /// # Panics
    /// If a circular image is narrower than its border.
    pub fn from_fn(
        [channels, height, width]: [usize; 3],
        border: Border,
        mut value: impl FnMut(usize, usize, usize) -> f32,
    ) -> Self {
        let mut planes = Self::zeros(channels, height, width);
        for channel in 0..channels {
            for y in 0..height {
                for (x, pixel) in planes.row_mut(channel / LANES, y).iter_mut().enumerate() {
                    pixel[channel % LANES] = value(channel, y, x);
                }
            }
        }
        planes.fill_border(border);
        planes
    }
    /// Creates an image from pixels without a border, in the order block, row, column.
    ///
    /// # Panics
    /// If their number is not blocks x height x width.
    pub fn from_inner(channels: usize, height: usize, width: usize, inner: &[Feature], border: Border) -> Self {
        assert_eq!(inner.len(), blocks(channels) * height * width);
        let mut planes = Self::zeros(channels, height, width);
        for (i, row) in inner.chunks_exact(width.max(1)).enumerate() {
            planes.row_mut(i / height, i % height).copy_from_slice(row);
        }
        planes.fill_border(border);
        planes
    }
}

impl<P: Deref<Target = [Feature]>> Planes<P> {
    /// Creates an image from pixels with borders, in the order block, row, column.
    pub(super) fn from_pixels(channels: usize, height: usize, width: usize, pixels: P) -> Self {
        assert_eq!(pixels.len(), n_pixels(channels, height, width));
        Self { channels, height, width, pixels }
    }
    /// A borrowed view of the image.
    pub fn view(&self) -> PlanesRef<'_> {
        Planes { channels: self.channels, height: self.height, width: self.width, pixels: &self.pixels }
    }
    /// The pixels without the border, in the order block, row, column.
    pub fn to_inner(&self) -> Vec<Feature> {
        let mut inner = Vec::with_capacity(self.n_blocks() * self.height * self.width);
        for block in 0..self.n_blocks() {
            (0..self.height).for_each(|y| inner.extend_from_slice(self.row(block, y)));
        }
        inner
    }
    /// A copy with its own memory.
    pub fn copied(&self) -> Planes {
        Planes { channels: self.channels, height: self.height, width: self.width, pixels: self.pixels.to_vec() }
    }
    /// Number of channels.
    #[inline(always)]
    pub fn channels(&self) -> usize {
        self.channels
    }
    /// Number of rows.
    #[inline(always)]
    pub fn height(&self) -> usize {
        self.height
    }
    /// Number of columns.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.width
    }
    /// Number of blocks.
    #[inline(always)]
    pub fn n_blocks(&self) -> usize {
        blocks(self.channels)
    }
    /// Pixels from one row to the next, with the border.
    #[inline(always)]
    pub fn pitch(&self) -> usize {
        self.width + 2 * BORDER
    }
    /// Number of pixels of a block, with the border.
    #[inline(always)]
    fn plane_len(&self) -> usize {
        self.pitch() * (self.height + 2 * BORDER)
    }
    /// A block with its border.
    #[inline(always)]
    pub fn plane(&self, block: usize) -> &[Feature] {
        &self.pixels[block * self.plane_len()..][..self.plane_len()]
    }
    #[inline(always)]
    fn start(&self, block: usize, y: usize) -> usize {
        block * self.plane_len() + (y + BORDER) * self.pitch() + BORDER
    }
    /// One row of a block without the border.
    #[inline(always)]
    pub fn row(&self, block: usize, y: usize) -> &[Feature] {
        &self.pixels[self.start(block, y)..][..self.width]
    }
    /// The values of the pixels without the border in the order of `PyTorch`: channel, row, column.
    pub fn to_channels_first(&self) -> Vec<f32> {
        let mut values = Vec::with_capacity(self.channels * self.height * self.width);
        for channel in 0..self.channels {
            for y in 0..self.height {
                values.extend(self.row(channel / LANES, y).iter().map(|pixel| pixel[channel % LANES]));
            }
        }
        values
    }
    /// All numbers, with borders and padding channels.
    pub fn values(&self) -> &[f32] {
        self.pixels.as_flattened()
    }
}

impl<P: DerefMut<Target = [Feature]>> Planes<P> {
    /// A mutably borrowed view of the image.
    pub fn view_mut(&mut self) -> PlanesMut<'_> {
        Planes { channels: self.channels, height: self.height, width: self.width, pixels: &mut self.pixels }
    }
    /// One row of a block without the border. Call [`Planes::fill_border`] after all rows are written.
    #[inline(always)]
    pub fn row_mut(&mut self, block: usize, y: usize) -> &mut [Feature] {
        let start = self.start(block, y);
        let width = self.width;
        &mut self.pixels[start..][..width]
    }
    /// Writes the pixels without the border. The values are in the order of `PyTorch`: channel, row, column.
    pub fn write_channels_first(&mut self, values: &[f32]) {
        for (i, row) in values.chunks_exact(self.width.max(1)).enumerate() {
            let channel = i / self.height;
            let y = i % self.height;
            let pixels = self.row_mut(channel / LANES, y);
            pixels.iter_mut().zip(row).for_each(|(pixel, value)| pixel[channel % LANES] = *value);
        }
    }
    /// All numbers, with borders and padding channels.
    pub fn values_mut(&mut self) -> &mut [f32] {
        self.pixels.as_flattened_mut()
    }
    /// Writes the padding beyond the left and right edge.
    ///
    /// # Panics
    /// If a circular image is narrower than its border.
    pub fn fill_border(&mut self, border: Border) {
        let pitch = self.pitch();
        let width = self.width;
        let rows = self.height + 2 * BORDER;
        assert!(border == Border::Zero || width >= BORDER, "a circular image of {width} columns");
        for block in 0..self.n_blocks() {
            for y in BORDER..rows - BORDER {
                let row = &mut self.pixels[(block * rows + y) * pitch..][..pitch];
                match border {
                    Border::Circular => {
                        row.copy_within(width..width + BORDER, 0);
                        row.copy_within(BORDER..2 * BORDER, width + BORDER);
                    }
                    Border::Zero => {
                        row[..BORDER].fill([0.0; LANES]);
                        row[width + BORDER..].fill([0.0; LANES]);
                    }
                }
            }
        }
    }
}
