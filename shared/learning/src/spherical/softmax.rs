//! Votes of pixels from the network's results.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::elementary::exp;
use super::{PolarImage, PolarPixel};
use crate::engine::{LANES, Planes};
use pulp::NullaryFnOnce;

/// Classes of a model at most: there are 23.
pub(super) const MAX_CLASSES: usize = 32;

/// From logits to votes, 0 to 255 for probabilities of 0 to 1.
pub(super) struct Softmax<'a> {
    pub(super) image: &'a PolarImage,
    pub(super) logits: &'a Planes,
    /// Columns side by side in the channels of the logits.
    pub(super) fold: usize,
    pub(super) n_classes: usize,
    pub(super) temperature: f32,
    /// Rows of the classes by pixel of the image. Those of pixels without a point mean nothing.
    pub(super) votes: &'a mut [u8],
}

impl NullaryFnOnce for Softmax<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { image, logits, fold, n_classes, temperature, votes } = self;
        assert!(n_classes <= MAX_CLASSES);
        // The channels of each pixel of a row side by side.
        let n_channels = logits.n_blocks() * LANES;
        let mut of_row = vec![0.0_f32; logits.width() * n_channels];
        let rows = image.pixels.chunks_exact(image.columns).zip(votes.chunks_exact_mut(image.columns * n_classes));
        for (row, (pixels, votes)) in rows.enumerate() {
            for block in 0..logits.n_blocks() {
                let pixels = of_row.chunks_exact_mut(n_channels).zip(logits.row(block, row));
                pixels.for_each(|(of_pixel, lanes)| of_pixel[block * LANES..][..LANES].copy_from_slice(lanes));
            }
            let tiles = pixels.chunks(LANES).zip(votes.chunks_mut(LANES * n_classes)).enumerate();
            for (tile, (pixels, votes)) in tiles.filter(|(_, (pixels, _))| pixels.iter().any(PolarPixel::is_valid)) {
                let mut values = [[0.0; LANES]; MAX_CLASSES];
                for pixel in 0..pixels.len() {
                    let column = tile * LANES + pixel;
                    let first = column / fold * n_channels + column % fold * n_classes;
                    for (values, logit) in values.iter_mut().zip(&of_row[first..first + n_classes]) {
                        values[pixel] = *logit;
                    }
                }
                let of_tile = softmax(&mut values[..n_classes], 1.0 / temperature);
                for (pixel, votes) in votes.chunks_exact_mut(n_classes).enumerate() {
                    for (vote, of_class) in votes.iter_mut().zip(&of_tile) {
                        *vote = of_class[pixel];
                    }
                }
            }
        }
    }
}

/// Of the logits, times `scale`, of 16 pixels at a time; rows by class.
#[inline(always)]
fn softmax(values: &mut [[f32; LANES]], scale: f32) -> [[u8; LANES]; MAX_CLASSES] {
    let mut largest = [f32::NEG_INFINITY; LANES];
    for of_class in values.iter() {
        for i in 0..LANES {
            largest[i] = if of_class[i] > largest[i] { of_class[i] } else { largest[i] };
        }
    }
    let mut sums = [0.0; LANES];
    for of_class in values.iter_mut() {
        for i in 0..LANES {
            of_class[i] = exp((of_class[i] - largest[i]) * scale);
            sums[i] += of_class[i];
        }
    }
    let mut votes = [[0; LANES]; MAX_CLASSES];
    for (votes, of_class) in votes.iter_mut().zip(values.iter()) {
        for i in 0..LANES {
            // In a number of 2^23 and above the lowest bits are whole ones: the sum is rounded.
            votes[i] = (of_class[i] * (255.0 / sums[i]) + 8_388_608.0).to_bits() as u8;
        }
    }
    votes
}
