//! Votes of pixels from the network's results.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::PolarImage;
use super::elementary::exp;
use crate::engine::{LANES, Planes};
use pulp::NullaryFnOnce;

/// Classes of a model at most: there are 23. Two AVX-512 registers.
pub(super) const MAX_CLASSES: usize = 32;

/// Probabilities of the classes, 0 to 255 for 0 to 1; zeros beyond the last class.
pub(super) type Vote = [u8; MAX_CLASSES];

/// From logits to votes.
pub(super) struct Softmax<'a> {
    pub(super) image: &'a PolarImage,
    pub(super) logits: &'a Planes,
    /// Columns side by side in the channels of the logits.
    pub(super) fold: usize,
    pub(super) n_classes: usize,
    pub(super) temperature: f32,
    /// By pixel of the image. Those of pixels without a point are left as they are.
    pub(super) votes: &'a mut [Vote],
}

impl NullaryFnOnce for Softmax<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { image, logits, fold, n_classes, temperature, votes } = self;
        assert!(n_classes <= MAX_CLASSES);
        // All channels of one pixel of the logits, and what is read beyond the last class.
        let mut channels = vec![0.0_f32; logits.n_blocks() * LANES + MAX_CLASSES];
        let folded = image.pixels.chunks_exact(fold).zip(votes.chunks_exact_mut(fold));
        for (at, (pixels, votes)) in folded.enumerate() {
            for block in 0..logits.n_blocks() {
                let lanes = &logits.row(block, at / logits.width())[at % logits.width()];
                channels[block * LANES..][..LANES].copy_from_slice(lanes);
            }
            for (i, (_, vote)) in pixels.iter().zip(votes).enumerate().filter(|(_, (pixel, _))| pixel.is_valid()) {
                let mut values = [f32::NEG_INFINITY; MAX_CLASSES];
                let from = &channels[i * n_classes..][..MAX_CLASSES];
                for class in 0..MAX_CLASSES {
                    values[class] = if class < n_classes { from[class] } else { f32::NEG_INFINITY };
                }
                *vote = softmax(&values, 1.0 / temperature);
            }
        }
    }
}

/// Of one pixel's logits, times `scale`.
#[inline(always)]
fn softmax(values: &[f32; MAX_CLASSES], scale: f32) -> Vote {
    let largest = reduced(values, |a, b| if a > b { a } else { b });
    let mut shares = [0.0; MAX_CLASSES];
    for i in 0..MAX_CLASSES {
        shares[i] = exp((values[i] - largest) * scale);
    }
    let factor = 255.0 / reduced(&shares, |a, b| a + b);
    let mut vote = [0; MAX_CLASSES];
    for i in 0..MAX_CLASSES {
        // In a number of 2^23 and above the lowest bits are whole ones: the sum is rounded.
        vote[i] = (shares[i] * factor + 8_388_608.0).to_bits() as u8;
    }
    vote
}

/// One number of all, by halves: each step is one vector instruction.
#[inline(always)]
fn reduced(values: &[f32; MAX_CLASSES], join: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = *values;
    for width in [16, 8, 4, 2, 1] {
        for i in 0..width {
            half[i] = join(half[i], half[i + width]);
        }
    }
    half[0]
}
