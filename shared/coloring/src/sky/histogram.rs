//! The colors of the sky: frequent where there are no points, rare on points.

use super::rim::{RimMap, Surroundings};
use super::tint::Tint;
use crate::color_image::ColorImage;
use crate::exposure::PosedExposure;
use crate::visibility::VisibilityMap;
use messages::ColorRow;

/// Bits of each channel that select a bin: 16 levels are wider than the noise of pixels and narrower than shades of blue.
const BIN_BITS: u32 = 4;
const N_BINS: usize = 1 << (3 * BIN_BITS);

/// One cell in this many is counted: an exposure has 100 000, and a submap dozens of exposures.
const CELL_STEP: usize = 31;

/// Least ratio between the frequency of a sky color without points and its frequency on points. With 2.5, a seventh fewer
/// points on trees get the color of the sky, and a permille fewer of all points get a color; with 8, a seventh and a
/// permille more.
const MIN_RATIO: f64 = 4.0;

/// Colors, by the bins of a histogram.
#[derive(Debug)]
pub struct ColorSet {
    contains: Vec<bool>,
    /// `None` if the set is empty.
    pub mean: Option<Tint>,
}

impl ColorSet {
    /// Whether the set contains a color.
    pub fn contains(&self, color: [u8; 3]) -> bool {
        self.contains[bin(color)]
    }
}

/// Number of cells of each color, with and without points.
pub struct Counts {
    empty: Vec<u32>,
    hit: Vec<u32>,
}

impl Default for Counts {
    fn default() -> Self {
        Self { empty: vec![0; N_BINS], hit: vec![0; N_BINS] }
    }
}

impl Counts {
    /// Counts the cells of one exposure.
    pub fn new(exposure: &PosedExposure<'_>, visibility: &VisibilityMap, rim: &RimMap, image: &ColorImage<'_>) -> Self {
        let mut counts = Self::default();
        for cell in (0..visibility.grid.n_cells()).step_by(CELL_STEP) {
            let pixel = visibility.grid.pixel(cell);
            if !exposure.contains(pixel[0], pixel[1]) {
                continue;
            }
            let counts = match rim.surroundings(cell as u32) {
                Surroundings::Nothing => &mut counts.empty,
                Surroundings::Surface => &mut counts.hit,
                Surroundings::Rim => continue,
            };
            let ColorRow { r, g, b, .. } = image.sample(pixel);
            counts[bin([r, g, b])] += 1;
        }
        counts
    }

    pub fn add(&mut self, other: &Self) {
        for (sums, counts) in [(&mut self.empty, &other.empty), (&mut self.hit, &other.hit)] {
            sums.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        }
    }

    /// The colors of the sky.
    pub fn sky(&self) -> ColorSet {
        let [n_empty, n_hit] = [&self.empty, &self.hit].map(|counts| f64::from(counts.iter().sum::<u32>().max(1)));
        let least = median_brightness(&self.hit);
        let is_sky = |bin: usize| {
            // One more hit, because a color that is seen once is not significant.
            let ratio = f64::from(self.empty[bin]) / n_empty * n_hit / f64::from(self.hit[bin] + 1);
            ratio >= MIN_RATIO && brightness(bin) > least
        };
        let is_sky: Vec<bool> = (0..N_BINS).map(is_sky).collect();
        let of_sky = || (0..N_BINS).filter(|bin| is_sky[*bin]).map(|bin| (middle(bin), self.empty[bin] as f32));
        let n_sky: f32 = of_sky().map(|(_, n)| n).sum();
        let mean = |c: usize| of_sky().map(|(color, n)| color[c] * n / n_sky).sum::<f32>();
        let mean = (n_sky > 0.0).then(|| Tint::from_rgb([0, 1, 2].map(mean)));
        ColorSet { contains: is_sky, mean }
    }
}

fn bin(color: [u8; 3]) -> usize {
    color.iter().fold(0, |bin, level| bin << BIN_BITS | usize::from(level >> (8 - BIN_BITS)))
}

/// The channels of a bin, in steps of its levels.
fn channels(bin: usize) -> [usize; 3] {
    [2, 1, 0].map(|channel| bin >> (channel * BIN_BITS) & ((1 << BIN_BITS) - 1))
}

/// The color in the middle of a bin.
fn middle(bin: usize) -> [f32; 3] {
    channels(bin).map(|step| (step as f32 + 0.5) * (1 << (8 - BIN_BITS)) as f32)
}

/// Brightness of a bin, 0 to 4 times its levels.
fn brightness(bin: usize) -> usize {
    let [r, g, b] = channels(bin);
    r + 2 * g + b
}

/// The median brightness of the cells.
fn median_brightness(counts: &[u32]) -> usize {
    let mut by_brightness = vec![0; 4 << BIN_BITS];
    counts.iter().enumerate().for_each(|(bin, n)| by_brightness[brightness(bin)] += n);
    let half = counts.iter().sum::<u32>() / 2;
    let sums = by_brightness.iter().scan(0, |sum, n| {
        *sum += n;
        Some(*sum)
    });
    sums.take_while(|sum| *sum <= half).count()
}
