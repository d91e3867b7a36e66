//! The image format of the kernels.

/// Channels of a block: one AVX-512 register, two of AVX2.
pub const LANES: usize = 16;

/// The 16 channels of one pixel in one block.
pub type Feature = [f32; LANES];

/// Pixels around the image on each side: enough for filters of 5 x 5.
pub const BORDER: usize = 2;

/// What lies beyond the left and right edge. Above and below are zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// Zeros.
    Zero,
    /// The other edge: columns are angles of a full turn.
    Circular,
}

/// Blocks that hold a number of channels.
pub const fn blocks(channels: usize) -> usize {
    channels.div_ceil(LANES)
}

/// An image of any number of channels: one plane for every 16, rows from top to bottom, with a border around it. Channels
/// that fill up the last block are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    channels: usize,
    height: usize,
    width: usize,
    pixels: Vec<Feature>,
}

impl Planes {
    /// An image of zeros.
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        let n = blocks(channels) * (height + 2 * BORDER) * (width + 2 * BORDER);
        Self { channels, height, width, pixels: vec![[0.0; LANES]; n] }
    }
    /// From pixels without a border: blocks, rows, columns.
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
    /// The pixels without their border: blocks, rows, columns.
    pub fn to_inner(&self) -> Vec<Feature> {
        let mut inner = Vec::with_capacity(self.n_blocks() * self.height * self.width);
        for block in 0..self.n_blocks() {
            (0..self.height).for_each(|y| inner.extend_from_slice(self.row(block, y)));
        }
        inner
    }
    /// Channels.
    pub fn channels(&self) -> usize {
        self.channels
    }
    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }
    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Blocks of channels.
    pub fn n_blocks(&self) -> usize {
        blocks(self.channels)
    }
    /// Pixels from one row to the next.
    pub(super) fn pitch(&self) -> usize {
        self.width + 2 * BORDER
    }
    /// Pixels of a block, with the border.
    fn plane_len(&self) -> usize {
        self.pitch() * (self.height + 2 * BORDER)
    }
    /// A block with its border.
    pub(super) fn plane(&self, block: usize) -> &[Feature] {
        &self.pixels[block * self.plane_len()..][..self.plane_len()]
    }
    fn start(&self, block: usize, y: usize) -> usize {
        block * self.plane_len() + (y + BORDER) * self.pitch() + BORDER
    }
    /// One row of a block without the border.
    pub fn row(&self, block: usize, y: usize) -> &[Feature] {
        &self.pixels[self.start(block, y)..][..self.width]
    }
    /// One row of a block without the border. Call [`Planes::fill_border`] when all are written.
    pub fn row_mut(&mut self, block: usize, y: usize) -> &mut [Feature] {
        let (start, width) = (self.start(block, y), self.width);
        &mut self.pixels[start..][..width]
    }
    /// Adds an image of the same size, borders too.
    pub(crate) fn add(&mut self, other: &Self) {
        debug_assert_eq!(self.pixels.len(), other.pixels.len());
        let values = self.pixels.as_flattened_mut().iter_mut().zip(other.pixels.as_flattened());
        values.for_each(|(value, other)| *value += other);
    }
    /// Multiplies by an image of the same size, borders too.
    pub(crate) fn scale(&mut self, other: &Self) {
        debug_assert_eq!(self.pixels.len(), other.pixels.len());
        let values = self.pixels.as_flattened_mut().iter_mut().zip(other.pixels.as_flattened());
        values.for_each(|(value, other)| *value *= other);
    }
    /// Zero where an image of the same size is zero or less: a rectifier's derivative by its result.
    pub(crate) fn clear_where_zero(&mut self, other: &Self) {
        debug_assert_eq!(self.pixels.len(), other.pixels.len());
        let values = self.pixels.as_flattened_mut().iter_mut().zip(other.pixels.as_flattened());
        values.for_each(|(value, other)| *value = if *other > 0.0 { *value } else { 0.0 });
    }
    /// Brings the columns beyond the left and right edge up to date.
    ///
    /// # Panics
    /// If a circular image is narrower than its border.
    pub fn fill_border(&mut self, border: Border) {
        let (pitch, width, rows) = (self.pitch(), self.width, self.height + 2 * BORDER);
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
