//! Class probabilities of pixels from the logits of the network.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::PolarImage;
use super::elementary::exp;
use kernels::images::{LANES, PlanesRef};
use pulp::NullaryFnOnce;

/// Largest number of classes of a model: the class table has 23. Two AVX-512 registers.
pub const MAX_CLASSES: usize = 32;

/// Probabilities of the classes, 0 to 255 for 0 to 1; zero beyond the last class.
pub type Vote = [u8; MAX_CLASSES];

/// The vote of a point without a vote.
pub(super) const NO_VOTE: Vote = [0; MAX_CLASSES];

/// Computes votes from logits.
pub(super) struct Softmax<'a> {
    pub(super) image: &'a PolarImage,
    pub(super) logits: PlanesRef<'a>,
    /// Neighboring columns that share the channels of a pixel of the logits.
    pub(super) fold: usize,
    pub(super) n_classes: usize,
    pub(super) temperature: f32,
    /// Votes of the pixels. Votes of pixels without a point are not written.
    pub(super) votes: &'a mut [Vote],
}

/// One value for each of 16 pixels.
type Tile = [f32; LANES];

/// Votes of 16 pixels, four classes per word, the first in the lowest byte.
type Words = [[u32; LANES]; MAX_CLASSES / 4];

impl NullaryFnOnce for Softmax<'_> {
    type Output = ();

    // 16 pixels at a time: sums over classes are then vector sums, and no lane is unused.
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

/// Softmax of the logits of 16 pixels by class, multiplied by `scale`.
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
    // Pairwise summation has smaller rounding errors.
    let mut sums = shares;
    for width in [16, 8, 4, 2, 1] {
        for class in 0..width {
            for i in 0..LANES {
                sums[class][i] += sums[class + width][i];
            }
        }
    }
    let mut scales = sums[0];
    for i in 0..LANES {
        scales[i] = 255.0 / scales[i];
    }
    let mut words = [[0; LANES]; MAX_CLASSES / 4];
    for (word, shares) in words.iter_mut().zip(shares.as_chunks::<4>().0).take(values.len().div_ceil(4)) {
        for i in 0..LANES {
            // The lowest bits of a float of 2^23 and above are integers: the addition rounds.
            let byte = |class: usize| (shares[class][i] * scales[i] + 8_388_608.0).to_bits() & 0xff;
            word[i] = byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
        }
    }
    words
}

/// The vote of one pixel.
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
    fn votes_equal_softmax_probabilities() {
        let mut random = random::Random::for_stream(1, 0);
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
