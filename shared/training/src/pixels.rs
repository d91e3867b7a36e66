//! Conversion between the pixels of a batch of images and rows of class values.

use kernels::images::{LANES, Planes};
use rayon::prelude::*;

/// Least number of pixels that one task gathers.
const MIN_PIXELS: usize = 1024;

/// Layout of pixels in outputs: the channels hold `fold` neighboring columns.
pub(crate) struct Pixels {
    /// Channels per pixel.
    pub(crate) n_classes: usize,
    /// Pixels per column.
    pub(crate) fold: usize,
    /// Number of pixels up to the end of each image. Pixel indices continue from image to image, in raster order.
    pub(crate) ends: Vec<usize>,
}

impl Pixels {
    /// Pixels of images, with `fold` pixels per column.
    pub(crate) fn from_images(images: &[&Planes], n_classes: usize, fold: usize) -> Self {
        let mut end = 0;
        let ends = images.iter().map(|image| {
            end += image.height() * image.width() * fold;
            end
        });
        Self { n_classes, fold, ends: ends.collect() }
    }
    /// The first pixel of an image.
    pub(crate) fn first_of(&self, image: usize) -> usize {
        image.checked_sub(1).map_or(0, |before| self.ends[before])
    }
    /// Position of a pixel, from the columns of each image: image, row, column of the network and part of this column.
    pub(crate) fn place(&self, pixel: u32, columns_of: impl Fn(usize) -> usize) -> [usize; 4] {
        let image = self.ends.partition_point(|end| *end <= pixel as usize);
        let within = pixel as usize - self.first_of(image);
        let columns = columns_of(image) * self.fold;
        let row = within / columns;
        let column = within % columns;
        [image, row, column / self.fold, column % self.fold]
    }
    /// Image, row, column and first channel of a pixel.
    fn position(&self, pixel: u32, outputs: &[&Planes]) -> [usize; 4] {
        let [image, row, column, part] = self.place(pixel, |image| outputs[image].width());
        [image, row, column, part * self.n_classes]
    }
    /// The channels of these pixels, pixel by pixel.
    pub(crate) fn gather(&self, outputs: &[&Planes], pixels: &[u32]) -> Vec<f32> {
        let mut rows = vec![0.0; pixels.len() * self.n_classes];
        rows.par_chunks_exact_mut(self.n_classes).zip(pixels).with_min_len(MIN_PIXELS).for_each(|(values, &pixel)| {
            let [image, row, column, first] = self.position(pixel, outputs);
            for (channel, value) in (first..).zip(values) {
                *value = outputs[image].row(channel / LANES, row)[column][channel % LANES];
            }
        });
        rows
    }
    /// Images of the size of the outputs, with these rows at the pixels and zeros elsewhere.
    pub(crate) fn scatter(&self, rows: &[f32], pixels: &[u32], outputs: &[&Planes]) -> Vec<Planes> {
        let zeros = |output: &&Planes| Planes::zeros(output.channels(), output.height(), output.width());
        let mut images: Vec<Planes> = outputs.iter().map(zeros).collect();
        for (values, &pixel) in rows.chunks_exact(self.n_classes).zip(pixels) {
            let [image, row, column, first] = self.position(pixel, outputs);
            for (channel, value) in (first..).zip(values) {
                images[image].row_mut(channel / LANES, row)[column][channel % LANES] = *value;
            }
        }
        images
    }
}
