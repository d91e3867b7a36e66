//! Distances between a cloud and a true cloud.

use super::index::PointIndex;
use crate::Statistics;
use rayon::prelude::*;

/// Range and sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceSettings {
    /// Points without a point of the other cloud within this distance count as far, m. They are not included in means.
    pub reach_m: f32,
    /// Largest number of points whose neighbor is searched, spread evenly over the sorted points.
    pub max_samples: usize,
}

/// Distances from the points of one cloud to their nearest neighbors in the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Distances of the points with a neighbor within reach, m.
    pub near_m: Option<Statistics>,
    /// Share of the points without a neighbor within reach, 0 to 1.
    pub far: f64,
    /// Shares of all sampled points with a neighbor within 5, 10 and 20 cm.
    pub within: [f64; 3],
}

/// The distances of [`Distances::within`], m.
pub const WITHIN_M: [f64; 3] = [0.05, 0.1, 0.2];

/// Distances from the points of `from` to the nearest points of `to`. Both clouds are sampled, so even a perfect cloud has distances
/// above 0.
pub fn distances(from: &PointIndex, to: &PointIndex, settings: &DistanceSettings) -> Distances {
    let stride = from.points().len().div_ceil(settings.max_samples.max(1)).max(1);
    let samples: Vec<[f32; 3]> = from.points().iter().step_by(stride).copied().collect();
    let found: Vec<Option<f32>> = samples.par_iter().map(|point| to.nearest(*point, settings.reach_m)).collect();
    let n = found.len().max(1) as f64;
    let near: Vec<f64> = found.iter().flatten().map(|distance| f64::from(*distance)).collect();
    Distances {
        far: (found.len() - near.len()) as f64 / n,
        within: WITHIN_M.map(|limit| near.iter().filter(|distance| **distance <= limit).count() as f64 / n),
        near_m: Statistics::from_values(near),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifted_copy_has_distance_of_the_shift() {
        let grid = |shift: f32| -> Vec<[f32; 3]> {
            (0..2500_u16).map(|i| [f32::from(i % 50), f32::from(i / 50), shift]).collect()
        };
        let mut shifted = grid(0.07);
        shifted.push([500.0, 0.0, 0.0]);
        let [from, to] = [shifted, grid(0.0)].map(|points| PointIndex::new(points, 1.0));
        let settings = DistanceSettings { reach_m: 1.0, max_samples: 100_000 };
        let found = distances(&from, &to, &settings);
        let near = found.near_m.expect("has neighbors");
        assert!(near.n == 2500 && (near.median - 0.07).abs() < 1e-6);
        assert!((found.far - 1.0 / 2501.0).abs() < 1e-12);
        assert_eq!(found.within.map(|share| share > 0.99), [false, true, true]);
        assert_eq!(distances(&to, &from, &settings).far, 0.0);
    }
}
