//! Aligns the odometry with world positions before the pose graph is solved, which determines north.

use geometry::{Isometry3, Point3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Vector2, Vector3};

/// Positions of one point in two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// Position by the odometry, m.
    pub p_in_odom: Point3<f64>,
    /// Position in the world, m; may be an outlier.
    pub p_in_world: Point3<f64>,
    /// Weight, positive.
    pub weight: f64,
}

/// Result of [`align_odometry`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// A rotation about z and a translation.
    pub world_from_odom: Pose,
    /// Root mean square horizontal distance of the inliers from their center, m. It is the lever arm with which
    /// position errors rotate the result.
    pub spread_m: f64,
    /// Sum of the weights of the pairs.
    pub n_inliers: f64,
}

/// Residuals beyond this have less than a quarter of the weight in the last round, m: twice the error of a receiver
/// under the open sky.
const SCALE_M: f64 = 3.0;
/// Factor from round to round, as in [`crate::PoseGraph::solve`].
const SHARPENING: f64 = 1.4;
/// Number of parts of the drive from which the alignment starts, in addition to the whole drive: even if half of the
/// fixes are wrong, the fixes of some part are correct.
const N_PARTS: usize = 8;
/// Residuals with half the weight in the first round after the alignment of a part, m: a part constrains its own
/// position but not the heading.
const PART_SCALE_M: f64 = 12.0;

/// Rotation about z and translation that align the most pairs. The search starts from all pairs and from each part of
/// the drive, and uses graduated non-convexity (Yang et al. 2020; within each round the closed form of Umeyama 1991 in
/// two dimensions); the result with the most inliers is used. `yaw` is the rotation, if it is known. The height is the
/// weighted median of the differences. `None` without pairs.
pub fn align_odometry(pairs: &[PointPair], yaw: Option<f64>) -> Option<Alignment> {
    let all: Vec<f64> = pairs.iter().map(|pair| pair.weight).collect();
    if pairs.is_empty() {
        return None;
    }
    let start = weighted(pairs, &all, yaw);
    let worst = pairs.iter().map(|pair| squared_residual(&start, pair)).fold(0.0, f64::max);
    let mut best = refined(pairs, start, 2.0 * worst, yaw);
    let n_of_part = pairs.len().div_ceil(N_PARTS).max(2);
    for begin in (0..pairs.len()).step_by(n_of_part.div_ceil(2)) {
        let part = begin..(begin + n_of_part).min(pairs.len());
        let of_part = |(k, weight): (usize, &f64)| if part.contains(&k) { *weight } else { 0.0 };
        let weights: Vec<f64> = all.iter().enumerate().map(of_part).collect();
        let found = refined(pairs, weighted(pairs, &weights, yaw), PART_SCALE_M.powi(2), yaw);
        // The margin exceeds rounding: results from different starts are often identical.
        if found.n_inliers > 1.001 * best.n_inliers {
            best = found;
        }
    }
    best.world_from_odom.translation.z += median_height_error(pairs, &best);
    Some(best)
}

/// Difference in height of a pair, m, with its weight.
struct WeightedError {
    error_m: f64,
    weight: f64,
}

/// Median of the differences in height, each weighted by the pair's agreement with the alignment.
fn median_height_error(pairs: &[PointPair], alignment: &Alignment) -> f64 {
    let scale = SCALE_M * SCALE_M;
    let weight = |pair: &PointPair| pair.weight * (scale / (squared_residual(alignment, pair) + scale)).powi(2);
    let error = |pair: &PointPair| pair.p_in_world.z - (alignment.world_from_odom * pair.p_in_odom).z;
    let weighted = |pair: &PointPair| WeightedError { error_m: error(pair), weight: weight(pair) };
    let mut errors: Vec<WeightedError> = pairs.iter().map(weighted).collect();
    errors.sort_by(|a, b| a.error_m.total_cmp(&b.error_m));
    let mut rest = errors.iter().map(|error| error.weight).sum::<f64>() / 2.0;
    let half = |error: &&WeightedError| {
        rest -= error.weight;
        rest <= 0.0
    };
    errors.iter().find(half).map_or(0.0, |error| error.error_m)
}

fn squared_residual(alignment: &Alignment, pair: &PointPair) -> f64 {
    (alignment.world_from_odom * pair.p_in_odom - pair.p_in_world).xy().norm_squared()
}

/// Graduated non-convexity from a start; `scale` is the squared residual with a quarter of the weight in the first
/// round, m^2.
fn refined(pairs: &[PointPair], start: Alignment, scale: f64, yaw: Option<f64>) -> Alignment {
    let mut alignment = start;
    let mut scale = scale.max(2.0 * SCALE_M * SCALE_M);
    let mut weights = vec![0.0; pairs.len()];
    loop {
        for (weight, pair) in weights.iter_mut().zip(pairs) {
            *weight = pair.weight * (scale / (squared_residual(&alignment, pair) + scale)).powi(2);
        }
        alignment = weighted(pairs, &weights, yaw);
        if scale <= SCALE_M * SCALE_M {
            return alignment;
        }
        scale = (scale / SHARPENING).max(SCALE_M * SCALE_M);
    }
}

fn weighted(pairs: &[PointPair], weights: &[f64], yaw: Option<f64>) -> Alignment {
    let total: f64 = weights.iter().sum();
    let with_weights = || pairs.iter().zip(weights);
    let mean =
        |of: fn(&PointPair) -> Vector3<f64>| with_weights().map(|(p, w)| of(p) * *w).sum::<Vector3<f64>>() / total;
    let odom = mean(|p| p.p_in_odom.coords);
    let world = mean(|p| p.p_in_world.coords);
    let mut cosine = 0.0;
    let mut sine = 0.0;
    let mut squares = 0.0;
    for (pair, weight) in with_weights() {
        let a: Vector2<f64> = (pair.p_in_odom.coords - odom).xy();
        let b: Vector2<f64> = (pair.p_in_world.coords - world).xy();
        cosine += weight * a.dot(&b);
        sine += weight * a.perp(&b);
        squares += weight * a.norm_squared();
    }
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw.unwrap_or_else(|| sine.atan2(cosine)));
    Alignment {
        world_from_odom: Isometry3::from_parts(Translation3::from(world - rotation * odom), rotation),
        spread_m: (squares / total).sqrt(),
        n_inliers: total,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct TestPairs {
        truth: Pose,
        pairs: Vec<PointPair>,
    }

    fn test_pairs(error: impl Fn(usize) -> Vector3<f64>) -> TestPairs {
        let truth = Isometry3::new(Vector3::new(120.0, -40.0, 7.0), Vector3::z() * 2.2);
        let make = |k: usize| {
            let along = k as f64 * 5.0;
            let p_in_odom = Point3::new(along, 20.0 * (along / 60.0).sin(), 0.1);
            PointPair { p_in_odom, p_in_world: truth * p_in_odom + error(k), weight: 1.0 }
        };
        TestPairs { truth, pairs: (0..40).map(make).collect() }
    }

    #[test]
    fn alignment_with_a_quarter_of_consecutive_outliers_finds_the_true_rotation() {
        let error = |k: usize| Vector3::new(25.0, -40.0 + k as f64, 30.0);
        let TestPairs { truth, pairs } = test_pairs(|k| if (8..18).contains(&k) { error(k) } else { Vector3::zeros() });
        let found = align_odometry(&pairs, None).expect("there are pairs");
        assert!(found.world_from_odom.rotation.angle_to(&truth.rotation) < 0.01);
        let off = (found.world_from_odom * pairs[20].p_in_odom - truth * pairs[20].p_in_odom).xy().norm();
        assert!(off < 0.5, "{off} m");
        assert!((29.0..31.0).contains(&found.n_inliers), "{}", found.n_inliers);
    }

    /// A start from all pairs alone converges between both halves or rotates the drive by some degrees.
    #[test]
    fn alignment_with_drifting_outliers_in_nearly_half_keeps_the_most_inliers() {
        let drift = |k: usize| Vector3::new(10.0, 6.0, 9.0) * (1.0 - k as f64 / 40.0);
        let TestPairs { truth, pairs } = test_pairs(|k| if k < 19 { drift(k) } else { Vector3::zeros() });
        for yaw in [None, Some(2.2)] {
            let found = align_odometry(&pairs, yaw).expect("there are pairs");
            let off = (found.world_from_odom * pairs[30].p_in_odom - truth * pairs[30].p_in_odom).xy().norm();
            assert!(off < if yaw.is_some() { 0.8 } else { 2.0 }, "{off} m with {yaw:?}");
        }
    }

    #[test]
    fn alignment_of_a_short_path_reports_a_small_spread() {
        let pairs = test_pairs(|_| Vector3::zeros()).pairs;
        assert!(align_odometry(&pairs[..3], None).expect("there are pairs").spread_m < 10.0);
        assert!(align_odometry(&pairs, None).expect("there are pairs").spread_m > 50.0);
        assert_eq!(align_odometry(&[], None), None);
    }
}
