//! Sharpness of surfaces, computed without truth.

use super::index::PointIndex;
use super::patch::Patch;
use crate::Statistics;
use rayon::prelude::*;

/// Definition of a facade, and sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrispnessSettings {
    /// Radius of the neighborhoods, m.
    pub radius_m: f32,
    /// Largest number of points at which the entropy is computed, spread evenly over the sorted points.
    pub max_samples: usize,
    /// Least number of points of a neighborhood for the entropy.
    pub min_points: usize,
    /// Least number of points of a neighborhood for a facade.
    pub min_facade_points: usize,
    /// Largest thickness of a facade, m. Two copies of a wall that are closer count as one thick facade.
    pub max_thickness_m: f64,
}

impl Default for CrispnessSettings {
    fn default() -> Self {
        Self {
            radius_m: 0.3,
            max_samples: 200_000,
            min_points: 8,
            min_facade_points: 30,
            // A third of the radius. Points without structure have a thickness of 0.45 radii.
            max_thickness_m: 0.1,
        }
    }
}

/// Least extent along a facade, relative to a full disk (half of its radius). This excludes edges and thin objects.
const MIN_EXTENT: f64 = 0.6;
/// Largest tilt of a facade: sine of 15 degrees.
const MAX_TILT: f64 = 0.2588;

/// The sharpness of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crispness {
    /// Standard deviations perpendicular to the facades, m. `None` without facades.
    pub thickness_m: Option<Statistics>,
    /// Number of upright patches that are too thick for a facade: bushes, corners, and walls that appear twice.
    pub n_too_thick: usize,
    /// Mean map entropy, nats; lower is sharper. `None` if no neighborhood has enough points.
    pub mean_entropy: Option<f64>,
    /// Number of neighborhoods of the mean.
    pub n_entropies: usize,
}

/// Thickness of facades and mean map entropy.
///
/// **Thickness**: each cube of a grid of `radius_m` with points contributes one neighborhood: the points within `radius_m` of the
/// point nearest to the center of the cube. A neighborhood is a facade if it has `min_facade_points` points, the deviation along
/// its second axis is at least 0.3 radii (0.5 for a full disk), its normal is within 15 degrees of the horizontal, and the deviation
/// along the normal is at most `max_thickness_m`. This deviation is the thickness. Copies of a wall that are further apart than the
/// radius are separate facades here: only the distance to the truth shows them.
///
/// **Mean map entropy** (Droeschel and Behnke, ICRA 2018): the mean of `ln sqrt(det(2 pi e C))`, `C` the covariance of the points
/// within `radius_m` of a point, over all points or over `max_samples` of them.
pub fn crispness(index: &PointIndex, settings: &CrispnessSettings) -> Crispness {
    let radius_m = settings.radius_m;
    let facades: Vec<f64> = central_points(index, radius_m)
        .into_par_iter()
        .filter_map(|center| facade_thickness(index, center, settings))
        .collect();
    let (thin, thick): (Vec<f64>, Vec<f64>) = facades.into_iter().partition(|t| *t <= settings.max_thickness_m);

    let n_points = index.points().len();
    let stride = n_points.div_ceil(settings.max_samples.max(1)).max(1);
    let samples: Vec<[f32; 3]> = index.points().iter().step_by(stride).copied().collect();
    // Collected in order before summation, so that the sum does not depend on the number of threads.
    let entropies: Vec<Option<f64>> = samples
        .into_par_iter()
        .map(|center| Patch::around(index, center, radius_m))
        .map(|patch| patch.filter(|patch| patch.n_points >= settings.min_points).map(|patch| patch.entropy()))
        .collect();
    let entropies = Statistics::from_values(entropies.into_iter().flatten());
    Crispness {
        thickness_m: Statistics::from_values(thin),
        n_too_thick: thick.len(),
        mean_entropy: entropies.map(|entropies| entropies.mean),
        n_entropies: entropies.map_or(0, |entropies| entropies.n),
    }
}

/// Deviation along the normal of an upright patch, m.
fn facade_thickness(index: &PointIndex, center: [f32; 3], settings: &CrispnessSettings) -> Option<f64> {
    let patch = Patch::around(index, center, settings.radius_m)?;
    let is_wide = patch.deviations_m[1] >= 0.5 * MIN_EXTENT * f64::from(settings.radius_m);
    let is_upright = patch.normal.z.abs() <= MAX_TILT;
    let is_facade = patch.n_points >= settings.min_facade_points && is_wide && is_upright;
    is_facade.then_some(patch.deviations_m[0])
}

/// For each cube of a grid, the point nearest to its center; the first one of equally near points.
fn central_points(index: &PointIndex, cube_m: f32) -> Vec<[f32; 3]> {
    let cube = |point: &[f32; 3]| point.map(|value| (value / cube_m).floor() as i32);
    let off = |point: &[f32; 3]| point.iter().map(|value| ((value / cube_m).fract().abs() - 0.5).powi(2)).sum::<f32>();
    // The points of a cube are not contiguous in the index, whose columns are at least as wide as a cube.
    let mut by_cube: Vec<([i32; 3], f32, u32)> =
        index.points().par_iter().enumerate().map(|(i, point)| (cube(point), off(point), i as u32)).collect();
    by_cube.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    by_cube.dedup_by_key(|(cube, ..)| *cube);
    by_cube.into_iter().map(|(.., i)| index.points()[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of 4 x 3 m with two sheets, and thicker ground in front of it.
    fn street(half_thickness_m: f32) -> PointIndex {
        let wall = (0..120_000_u32).map(|i| {
            let side = if i % 2 == 0 { half_thickness_m } else { -half_thickness_m };
            [(i / 2 % 200) as f32 * 0.02, 5.0 + side, (i / 400) as f32 * 0.01]
        });
        let ground = (0..40_000_u32).map(|i| [(i % 200) as f32 * 0.02, (i / 200) as f32 * 0.02, (i % 7) as f32 * 0.02]);
        PointIndex::new(wall.chain(ground).collect(), 0.3)
    }

    #[test]
    fn thicker_wall_has_larger_thickness_and_entropy() {
        let settings = CrispnessSettings { max_samples: 20_000, ..CrispnessSettings::default() };
        let [thin, thick] = [0.01, 0.03].map(|half| crispness(&street(half), &settings));
        for (found, expected) in [(&thin, 0.01), (&thick, 0.03)] {
            let thickness = found.thickness_m.expect("has facades");
            assert!(thickness.n > 80 && (thickness.median - expected).abs() < 0.001, "{thickness:?}");
        }
        let [Some(less), Some(more)] = [thin, thick].map(|found| found.mean_entropy) else { panic!("no entropy") };
        // Three quarters of the points are on the wall, whose entropy increases by ln 3.
        assert!((more - less - 0.75 * 3.0_f64.ln()).abs() < 0.1, "{less} {more}");
        let doubled = crispness(&street(0.12), &settings);
        assert!(doubled.thickness_m.is_none_or(|t| t.n < 30) && doubled.n_too_thick > 150, "{doubled:?}");
    }
}
