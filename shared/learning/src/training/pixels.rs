//! Pixels of a batch of images as rows of their classes, and back.

use crate::engine::{LANES, Planes};

/// How pixels lie in results: `fold` neighboring columns side by side in the channels.
pub(super) struct Pixels {
    /// Channels of a pixel.
    pub(super) n_classes: usize,
    /// Pixels of one column.
    pub(super) fold: usize,
    /// Pixels of one image; they count on from image to image, in raster order.
    pub(super) of_image: usize,
}

impl Pixels {
    /// Image, row, column and first channel of a pixel.
    fn place(&self, pixel: u32, results: &[&Planes]) -> [usize; 4] {
        let (image, within) = (pixel as usize / self.of_image, pixel as usize % self.of_image);
        let columns = results[image].width() * self.fold;
        let (row, column) = (within / columns, within % columns);
        [image, row, column / self.fold, column % self.fold * self.n_classes]
    }
    /// The channels of these pixels, one pixel after the other.
    pub(super) fn gather(&self, results: &[&Planes], pixels: &[u32]) -> Vec<f32> {
        let mut rows = Vec::with_capacity(pixels.len() * self.n_classes);
        for &pixel in pixels {
            let [image, row, column, first] = self.place(pixel, results);
            let value = |channel: usize| results[image].row(channel / LANES, row)[column][channel % LANES];
            rows.extend((first..first + self.n_classes).map(value));
        }
        rows
    }
    /// Images like the results with these rows at the pixels, and zeros elsewhere.
    pub(super) fn scatter(&self, rows: &[f32], pixels: &[u32], results: &[&Planes]) -> Vec<Planes> {
        let zeros = |result: &&Planes| Planes::zeros(result.channels(), result.height(), result.width());
        let mut images: Vec<Planes> = results.iter().map(zeros).collect();
        for (values, &pixel) in rows.chunks_exact(self.n_classes).zip(pixels) {
            let [image, row, column, first] = self.place(pixel, results);
            for (channel, value) in (first..).zip(values) {
                images[image].row_mut(channel / LANES, row)[column][channel % LANES] = *value;
            }
        }
        images
    }
}
