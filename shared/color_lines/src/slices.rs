//! The pixels of each hemisphere, and where its Gaussians start.

use crate::histogram::{Cells, Histogram, Maximum};
use crate::k_means::k_means;
use crate::{Hemispheres, Points, Settings, Start};

/// A hemisphere with pixels.
#[derive(Clone, Debug)]
pub struct Slice {
    /// Its number, from 0 at the origin.
    pub hemisphere: usize,
    /// Numbers of its points.
    pub order: Vec<u32>,
    /// The points in this order: neighbors in memory are neighbors in space.
    pub points: Points,
    /// Where its Gaussians start.
    pub means: Vec<[f64; 3]>,
}

/// Divides points.
pub(crate) fn slices(points: &Points, hemispheres: &Hemispheres, settings: &Settings) -> Vec<Slice> {
    let cells = Cells::new(points, settings.bins);
    let mut counts = Vec::new();
    let (mut slices, mut maxima) = (Vec::new(), Vec::new());
    for (hemisphere, numbers) in hemispheres.sorted(points).into_iter().enumerate() {
        if !numbers.is_empty() {
            let histogram = cells.histogram(points, &numbers, &mut counts);
            maxima.push(cells.maxima(&histogram));
            let Histogram { order, points, .. } = histogram;
            slices.push(Slice { hemisphere, order, points, means: Vec::new() });
        }
    }
    match settings.start {
        Start::Contrast(h) => take_above(&mut slices, &maxima, h),
        Start::Count(n) => {
            let mut contrasts: Vec<f64> = maxima.iter().flatten().map(|maximum| maximum.contrast).collect();
            contrasts.sort_by(|a, b| b.total_cmp(a));
            // Of equal contrasts all or none: which one comes first would be chance.
            take_above(&mut slices, &maxima, contrasts.get(n).copied().unwrap_or(0.0));
        }
        Start::KMeans(n, seed) => slices.iter_mut().for_each(|slice| slice.means = k_means(&slice.points, n, seed)),
    }
    slices
}

/// Starts at the maxima above a contrast, and at the highest one of each slice.
fn take_above(slices: &mut [Slice], maxima: &[Vec<Maximum>], h: f64) {
    for (slice, maxima) in slices.iter_mut().zip(maxima) {
        let is_chosen = |maximum: &&Maximum| maximum.contrast > h || maximum.contrast.is_infinite();
        slice.means = maxima.iter().filter(is_chosen).map(|maximum| maximum.mean).collect();
    }
}
