//! Aligns the odometry with positions in the world before the pose graph is solved: where is north?

use geometry::{Isometry3, Point3, Pose, Translation3, UnitQuaternion};
use nalgebra::{Vector2, Vector3};

/// The same point in two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// m.
    pub p_in_odom: Point3<f64>,
    /// m; may be an outlier.
    pub p_in_world: Point3<f64>,
}

/// Result of [`align_odometry`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// A rotation about z and a translation.
    pub world_from_odom: Pose,
    /// Root mean square distance of the inliers from their center, horizontally, m. It is the lever arm with which errors
    /// of positions rotate the result.
    pub spread_m: f64,
    /// Sum of the weights of the pairs.
    pub n_inliers: f64,
}

/// Residuals beyond this count less than a quarter in the last round, m: twice the error of a receiver under the open sky.
const SCALE_M: f64 = 3.0;
/// Factor from round to round, as in [`crate::PoseGraph::solve`].
const SHARPENING: f64 = 1.4;

/// Rotation about z and translation that align the most pairs (graduated non-convexity, Yang et al. 2020; within each round
/// the closed form of Umeyama 1991 in two dimensions). The height is the mean of the differences. `None` without pairs.
pub fn align_odometry(pairs: &[PointPair]) -> Option<Alignment> {
    if pairs.is_empty() {
        return None;
    }
    let mut weights = vec![1.0; pairs.len()];
    let mut alignment = weighted(pairs, &weights);
    let squared_residual = |alignment: &Alignment, pair: &PointPair| {
        (alignment.world_from_odom * pair.p_in_odom - pair.p_in_world).xy().norm_squared()
    };
    let worst = pairs.iter().map(|pair| squared_residual(&alignment, pair)).fold(0.0, f64::max);
    let mut scale = 2.0 * worst.max(SCALE_M * SCALE_M);
    loop {
        for (weight, pair) in weights.iter_mut().zip(pairs) {
            *weight = (scale / (squared_residual(&alignment, pair) + scale)).powi(2);
        }
        alignment = weighted(pairs, &weights);
        if scale <= SCALE_M * SCALE_M {
            return Some(alignment);
        }
        scale = (scale / SHARPENING).max(SCALE_M * SCALE_M);
    }
}

fn weighted(pairs: &[PointPair], weights: &[f64]) -> Alignment {
    let total: f64 = weights.iter().sum();
    let with_weights = || pairs.iter().zip(weights);
    let mean =
        |of: fn(&PointPair) -> Vector3<f64>| with_weights().map(|(p, w)| of(p) * *w).sum::<Vector3<f64>>() / total;
    let (odom, world) = (mean(|p| p.p_in_odom.coords), mean(|p| p.p_in_world.coords));
    let (mut cosine, mut sine, mut squares) = (0.0, 0.0, 0.0);
    for (pair, weight) in with_weights() {
        let a: Vector2<f64> = (pair.p_in_odom.coords - odom).xy();
        let b: Vector2<f64> = (pair.p_in_world.coords - world).xy();
        cosine += weight * a.dot(&b);
        sine += weight * a.perp(&b);
        squares += weight * a.norm_squared();
    }
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sine.atan2(cosine));
    Alignment {
        world_from_odom: Isometry3::from_parts(Translation3::from(world - rotation * odom), rotation),
        spread_m: (squares / total).sqrt(),
        n_inliers: total,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(is_outlier: impl Fn(usize) -> bool) -> (Pose, Vec<PointPair>) {
        let truth = Isometry3::new(Vector3::new(120.0, -40.0, 7.0), Vector3::z() * 2.2);
        let make = |k: usize| {
            let along = k as f64 * 5.0;
            let p_in_odom = Point3::new(along, 20.0 * (along / 60.0).sin(), 0.1);
            let error = if is_outlier(k) { Vector3::new(25.0, -40.0 + k as f64, 30.0) } else { Vector3::zeros() };
            PointPair { p_in_odom, p_in_world: truth * p_in_odom + error }
        };
        (truth, (0..40).map(make).collect())
    }

    #[test]
    fn alignment_with_a_quarter_of_consecutive_outliers_finds_the_true_rotation() {
        let (truth, pairs) = pairs(|k| (8..18).contains(&k));
        let found = align_odometry(&pairs).expect("there are pairs");
        assert!(found.world_from_odom.rotation.angle_to(&truth.rotation) < 0.01);
        let off = (found.world_from_odom * pairs[20].p_in_odom - truth * pairs[20].p_in_odom).xy().norm();
        assert!(off < 0.5, "{off} m");
        assert!((29.0..31.0).contains(&found.n_inliers), "{}", found.n_inliers);
    }

    #[test]
    fn alignment_of_a_short_path_reports_a_small_spread() {
        let (_, pairs) = pairs(|_| false);
        assert!(align_odometry(&pairs[..3]).expect("there are pairs").spread_m < 10.0);
        assert!(align_odometry(&pairs).expect("there are pairs").spread_m > 50.0);
        assert_eq!(align_odometry(&[]), None);
    }
}
