//! Images with a frame of one pixel, so that every pixel has all neighbors.

use crate::level::Level;
use crate::neighbors::Connectivity;
use ndarray::Array2;

/// An image with a frame of one pixel. Rows have `stride` pixels.
pub(crate) struct Padded<T> {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    /// Distance from a pixel to the pixel below, in flat indices.
    pub(crate) stride: usize,
    pub(crate) pixels: Vec<T>,
}

impl<T: Copy> Padded<T> {
    /// An image of one value, including the frame.
    pub(crate) fn filled((rows, cols): (usize, usize), value: T) -> Self {
        let stride = cols + 2;
        let n = (rows + 2) * (cols + 2);
        assert!(
            n < u32::MAX as usize,
            "image of {rows} x {cols} pixels is too large; at most 2^32 - 2 pixels are supported"
        );
        Self { rows, cols, stride, pixels: vec![value; n] }
    }
    /// An image with a frame of one value.
    pub(crate) fn new(image: &Array2<T>, frame: T) -> Self {
        Self::mapped(image, frame, |value| value)
    }
    /// The mapped image with a frame of one value.
    pub(crate) fn mapped<S: Copy>(image: &Array2<S>, frame: T, map: impl Fn(S) -> T) -> Self {
        let mut padded = Self::filled(image.dim(), frame);
        let image = image.as_standard_layout();
        for (row, line) in image.rows().into_iter().enumerate() {
            let into = padded.row_mut(row);
            for (value, &pixel) in into.iter_mut().zip(line) {
                *value = map(pixel);
            }
        }
        padded
    }
    /// Flat index of the first pixel of a row.
    pub(crate) fn row_start(&self, row: usize) -> usize {
        (row + 1) * self.stride + 1
    }
    /// The pixels of a row, without the frame.
    pub(crate) fn row(&self, row: usize) -> &[T] {
        let start = self.row_start(row);
        &self.pixels[start..start + self.cols]
    }
    /// The pixels of a row, without the frame.
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [T] {
        let start = self.row_start(row);
        let cols = self.cols;
        &mut self.pixels[start..start + cols]
    }
    /// Fills the frame with a value.
    pub(crate) fn fill_frame(&mut self, value: T) {
        let stride = self.stride;
        let n = self.pixels.len();
        self.pixels[..stride].fill(value);
        self.pixels[n - stride..].fill(value);
        for row in self.pixels.chunks_exact_mut(stride) {
            (row[0], row[stride - 1]) = (value, value);
        }
    }
    /// The rows above, at and below a row, including the frame.
    pub(crate) fn three_rows(&self, row: usize) -> [&[T]; 3] {
        [0, 1, 2].map(|i| &self.pixels[(row + i) * self.stride..(row + i + 1) * self.stride])
    }
    /// The mapped image without the frame.
    pub(crate) fn unframed<S>(&self, map: impl Fn(T) -> S) -> Array2<S> {
        let mut pixels = Vec::with_capacity(self.rows * self.cols);
        for row in 0..self.rows {
            pixels.extend(self.row(row).iter().map(|&value| map(value)));
        }
        Array2::from_shape_vec((self.rows, self.cols), pixels).expect("one value for every pixel")
    }
    /// Offsets in flat indices to all neighbors; the neighbors before a pixel come first.
    pub(crate) fn steps(&self, connectivity: Connectivity) -> Vec<isize> {
        let before = connectivity.before().iter().map(|&(row, col)| row * self.stride as isize + col);
        before.clone().chain(before.rev().map(|step| -step)).collect()
    }
}

/// Three slices of `n` pixels of a framed row: one pixel before, at, and one pixel after its pixels.
#[inline(always)]
pub(crate) fn shifted<T>(row: &[T], n: usize) -> [&[T]; 3] {
    [&row[..n], &row[1..=n], &row[2..n + 2]]
}

/// Maximum of the neighbors in the row above or below.
#[inline(always)]
pub(crate) fn sup_across<T: Level>([before, at, after]: [&[T]; 3], i: usize, connectivity: Connectivity) -> T {
    match connectivity {
        Connectivity::Four => at[i],
        Connectivity::Eight => before[i].sup(at[i]).sup(after[i]),
    }
}
