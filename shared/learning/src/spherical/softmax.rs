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

/// One number for each of 16 pixels of the logits.
type Tile = [f32; LANES];

/// Votes of 16 pixels, four classes in each word, the first in its lowest byte.
type Words = [[u32; LANES]; MAX_CLASSES / 4];

impl NullaryFnOnce for Softmax<'_> {
    type Output = ();

    // 16 pixels side by side: sums over classes are then sums of vectors, and no lane is lost to classes that are not there.
    #[inline(always)]
    fn call(self) {
        let Self { image, logits, fold, n_classes, temperature, votes } = self;
        assert!(n_classes <= MAX_CLASSES);
        let mut channels = vec![[0.0_f32; LANES]; logits.n_blocks() * LANES];
        for row in 0..image.rows {
            for first in (0..logits.width()).step_by(LANES) {
                let n = LANES.min(logits.width() - first);
                for (block, channels) in channels.chunks_exact_mut(LANES).enumerate() {
                    for (x, pixel) in logits.row(block, row)[first..first + n].iter().enumerate() {
                        for lane in 0..LANES {
                            channels[lane][x] = pixel[lane];
                        }
                    }
                }
                for column in 0..fold {
                    let words = softmax(&channels[column * n_classes..][..n_classes], 1.0 / temperature);
                    for x in 0..n {
                        let at = row * image.columns + (first + x) * fold + column;
                        if image.pixels[at].is_valid() {
                            votes[at] = vote(&words, x);
                        }
                    }
                }
            }
        }
    }
}

/// Of 16 pixels' logits by class, times `scale`.
#[inline(always)]
fn softmax(values: &[Tile], scale: f32) -> Words {
    let mut largest = [f32::NEG_INFINITY; LANES];
    for of_class in values {
        for i in 0..LANES {
            largest[i] = if of_class[i] > largest[i] { of_class[i] } else { largest[i] };
        }
    }
    let mut shares = [[0.0; LANES]; MAX_CLASSES];
    for (share, of_class) in shares.iter_mut().zip(values) {
        for i in 0..LANES {
            share[i] = exp((of_class[i] - largest[i]) * scale);
        }
    }
    // By halves, which rounds less than one after another.
    let mut sums = shares;
    for width in [16, 8, 4, 2, 1] {
        for class in 0..width {
            for i in 0..LANES {
                sums[class][i] += sums[class + width][i];
            }
        }
    }
    let mut words = [[0; LANES]; MAX_CLASSES / 4];
    for class in 0..values.len() {
        for i in 0..LANES {
            // In a number of 2^23 and above the lowest bits are whole ones: the sum is rounded.
            let share = shares[class][i] * (255.0 / sums[0][i]) + 8_388_608.0;
            words[class / 4][i] |= (share.to_bits() & 0xff) << (class % 4 * 8);
        }
    }
    words
}

/// That of one pixel.
#[inline(always)]
fn vote(words: &Words, pixel: usize) -> Vote {
    let mut vote = [0; MAX_CLASSES];
    for (bytes, word) in vote.as_chunks_mut::<4>().0.iter_mut().zip(words) {
        *bytes = word[pixel].to_le_bytes();
    }
    vote
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes_are_the_probabilities_of_every_pixel() {
        let mut random = crate::Random::new(1, 0);
        for n_classes in [1, 3, 19, 32] {
            let logits: Vec<Tile> = (0..n_classes).map(|_| [(); LANES].map(|()| 4.0 * random.gauss())).collect();
            let words = softmax(&logits, 0.5);
            for pixel in 0..LANES {
                let shares: Vec<f64> = logits.iter().map(|of_class| f64::from(0.5 * of_class[pixel]).exp()).collect();
                let sum: f64 = shares.iter().sum();
                for (class, got) in vote(&words, pixel).into_iter().enumerate() {
                    let expected = shares.get(class).map_or(0.0, |share| 255.0 * share / sum);
                    assert!((f64::from(got) - expected).abs() < 0.501, "{got} for {expected}");
                }
            }
        }
    }
}
