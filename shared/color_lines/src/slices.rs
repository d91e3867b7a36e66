//! The pixels of each hemisphere, and the starts of its Gaussians.

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
    /// Starts of its Gaussians.
    pub means: Vec<[f64; 3]>,
}

/// Divides points into hemispheres.
pub(crate) fn slices(points: &Points, hemispheres: &Hemispheres, settings: &Settings) -> Vec<Slice> {
    let cells = Cells::new(points, settings.bins);
    let mut counts = Vec::new();
    let mut slices = Vec::new();
    let mut maxima = Vec::new();
    for (hemisphere, numbers) in hemispheres.sorted(points).into_iter().enumerate() {
        if !numbers.is_empty() {
            let histogram = cells.histogram(points, &numbers, &mut counts);
            maxima.push(cells.maxima(&histogram, &mut counts));
            let Histogram { order, points, .. } = histogram;
            slices.push(Slice { hemisphere, order, points, means: Vec::new() });
        }
    }
    match settings.start {
        Start::Contrast(h) => {
            for (slice, maxima) in slices.iter_mut().zip(&maxima) {
                // The highest maximum has an infinite contrast.
                slice.means =
                    maxima.iter().filter(|maximum| maximum.contrast > h).map(|maximum| maximum.mean).collect();
            }
        }
        Start::Count(n) => take_highest(&mut slices, &maxima, n),
        Start::KMeans(n, seed) => {
            for slice in &mut slices {
                slice.means = k_means(&slice.points, n, seed);
            }
        }
    }
    slices
}

/// Starts at the `n` maxima of the highest contrast over all slices, and at the highest maximum of each slice. For equal
/// contrasts, inner slices come first.
fn take_highest(slices: &mut [Slice], maxima: &[Vec<Maximum>], n: usize) {
    let mut all: Vec<(usize, &Maximum)> = maxima
        .iter()
        .enumerate()
        .flat_map(|(slice, maxima)| maxima.iter().map(move |maximum| (slice, maximum)))
        .collect();
    all.sort_by(|a, b| b.1.contrast.total_cmp(&a.1.contrast));
    for (slice, maximum) in all.into_iter().take(n.max(slices.len())) {
        slices[slice].means.push(maximum.mean);
    }
}
