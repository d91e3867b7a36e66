//! Gain compensation: removes brightness steps between exposures on one surface.
//!
//! Points that are visible in two exposures give the ratio of their brightness. One gain per exposure is estimated from all
//! ratios by weighted least squares (Brown and Lowe, "Automatic Panoramic Image Stitching using Invariant Features", IJCV
//! 2007, section 6). Colors of two exposures are not blended: pose errors would blur the result.

use crate::candidates::Candidates;
use crate::chunk::{CHUNK, Chunk};
use crate::color_image::ColorImage;
use messages::ColorRow;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// One point in this many is looked up in all exposures: some thousands per submap, for some dozens of gains.
const THINNING: usize = 64;

/// Usable levels of a channel, of 255. Outside this range, the sensor is saturated or noise dominates.
const USABLE: std::ops::RangeInclusive<u8> = 10..=240;

/// Largest logarithm of a brightness ratio. A larger ratio means that the two exposures show different surfaces.
const MAX_LOG_RATIO: f64 = 1.0;

/// Standard deviation of a logarithmic ratio. Larger residuals get a lower weight (Cauchy weight).
const DEVIATION: f64 = 0.1;

/// Weight of the prior that a gain is 1, in ratios: about ten points share a surface, and gains differ by 0.3.
const PRIOR: f64 = 2.0;

/// Iterations of weighting and solving: the fourth changes gains by less than 0.01.
const N_ITERATIONS: usize = 4;

/// A factor for the colors of each exposure.
#[derive(Clone, Debug)]
pub struct ExposureGains(Vec<f32>);

/// One point that is visible in two exposures.
#[derive(Clone, Copy, Debug)]
pub struct Overlap {
    /// Indices of the exposures.
    pub exposures: [usize; 2],
    /// Pixel of the point in each exposure.
    pub pixels: [[f32; 2]; 2],
}

impl ExposureGains {
    /// The gains that make the exposures most similar. `images[i]` belongs to exposure `i`.
    pub fn estimate(candidates: &Candidates<'_>, images: &[ColorImage<'_>]) -> Self {
        let ratio = |overlap: Overlap| BrightnessRatio::new(&overlap, images);
        let ratios: Vec<BrightnessRatio> = overlaps(candidates, THINNING, 0).into_iter().filter_map(ratio).collect();
        Self(log_gains(&ratios, candidates.exposures.len()).into_iter().map(|log| (-log).exp() as f32).collect())
    }

    /// A color of an exposure, scaled to the mean brightness of all exposures.
    #[inline]
    pub fn leveled(&self, row: ColorRow, exposure: usize) -> ColorRow {
        let [r, g, b] = [row.r, row.g, row.b].map(|level| (f32::from(level) * self.0[exposure] + 0.5) as u8);
        ColorRow { r, g, b, ..row }
    }
}

/// Overlaps of static points: point `first` of every chunk and each `every`-th point after it. For each point, every
/// exposure that shows it is paired with the next one that does.
pub fn overlaps(candidates: &Candidates<'_>, every: usize, first: usize) -> Vec<Overlap> {
    let of_chunk = |chunk: &mut Chunk, index: usize| {
        candidates.points.read_chunk(index, chunk);
        let chunk = &*chunk;
        let near: Vec<usize> =
            (0..candidates.exposures.len()).filter(|exposure| candidates.may_see(*exposure, chunk)).collect();
        let mut overlaps = Vec::new();
        for i in (first..chunk.n_points.min(CHUNK)).step_by(every).filter(|i| chunk.moves[*i] == 0) {
            let mut last = None;
            for exposure in near.iter().copied() {
                let Some(pixel) = candidates.visible_pixel(exposure, chunk, i) else { continue };
                if let Some((before, at)) = last.replace((exposure, pixel)) {
                    overlaps.push(Overlap { exposures: [before, exposure], pixels: [at, pixel] });
                }
            }
        }
        overlaps
    };
    let chunks = (0..candidates.points.n_chunks()).into_par_iter();
    chunks.map_init(Chunk::default, of_chunk).flatten_iter().collect()
}

/// Logarithm of the brightness of a point in the first exposure, minus the logarithm in the second.
struct BrightnessRatio {
    exposures: [usize; 2],
    log_ratio: f64,
}

impl BrightnessRatio {
    fn new(overlap: &Overlap, images: &[ColorImage<'_>]) -> Option<Self> {
        let level = |i: usize| {
            let ColorRow { r, g, b, .. } = images[overlap.exposures[i]].sample(overlap.pixels[i]);
            let is_usable = [r, g, b].iter().all(|level| USABLE.contains(level));
            is_usable.then(|| f64::from(r) + 2.0 * f64::from(g) + f64::from(b))
        };
        let log_ratio = (level(0)? / level(1)?).ln();
        (log_ratio.abs() < MAX_LOG_RATIO).then_some(Self { exposures: overlap.exposures, log_ratio })
    }
}

/// Logarithms of the gains of `n` exposures. Ratios that contradict the previous solution get less weight.
fn log_gains(ratios: &[BrightnessRatio], n: usize) -> Vec<f64> {
    let mut gains: DVector<f64> = DVector::zeros(n);
    for _ in 0..N_ITERATIONS {
        let mut normal = DMatrix::from_diagonal_element(n, n, PRIOR);
        let mut right: DVector<f64> = DVector::zeros(n);
        for BrightnessRatio { exposures: [a, b], log_ratio } in ratios {
            let a = *a;
            let b = *b;
            let residual = log_ratio - (gains[a] - gains[b]);
            let weight = 1.0 / (1.0 + (residual / DEVIATION).powi(2));
            right[a] += weight * log_ratio;
            right[b] -= weight * log_ratio;
            normal[(a, a)] += weight;
            normal[(b, b)] += weight;
            normal[(a, b)] -= weight;
            normal[(b, a)] -= weight;
        }
        // The prior makes the matrix positive definite unless a ratio is not finite. In this case the previous gains are
        // kept.
        if let Some(factors) = normal.cholesky() {
            gains = factors.solve(&right);
        }
    }
    gains.as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_follow_from_brightness_ratios_with_outliers() {
        let gains = [0.3, -0.2, 0.0, -0.1];
        let ratios: Vec<BrightnessRatio> = (0..4000_usize)
            .map(|i| {
                let exposures = [i % 4, (i + 1 + i / 4 % 3) % 4];
                // One in ten is an outlier.
                let wrong = if i % 10 == 3 { 0.7 } else { 0.0 };
                BrightnessRatio { exposures, log_ratio: gains[exposures[0]] - gains[exposures[1]] + wrong }
            })
            .collect();
        let found = log_gains(&ratios, 5);
        for (i, known) in gains.iter().chain(&[0.0]).enumerate() {
            assert!((found[i] - known).abs() < 0.01, "{i}: {} instead of {known}", found[i]);
        }
    }

    #[test]
    fn gains_are_one_without_overlaps() {
        assert_eq!(log_gains(&[], 3), [0.0; 3]);
    }
}
