//! Deviations of the result beyond those of the least-squares problem: what the fixes have in common, and their disagreement.

use crate::fixes::UsedFix;
use crate::{AntennaPosition, Solution};
use geometry::Pose;
use nalgebra::{Matrix6, Vector3};

/// Share of the mean squared distance of the fixes that the result may be off, too: where fixes err by meters, those beside
/// them err with them. By simulated drives (`docs/experiments/georeferencing.md`).
const SPREAD_SHARE: f64 = 0.02;
/// While most fixes agree, farther ones count as this far, m: they are wrong for reasons of their own.
const FAR_M: f64 = 10.0;
/// At least this share of the fixes agrees, for the growth with the share that does not.
const MIN_USED_SHARE: f64 = 0.05;

/// Adds common errors to the covariances of placed submaps. Standard deviations grow with the share of rejected fixes; if it is
/// above one half, by the distance of all fixes.
pub(crate) fn add_common_errors(solution: &mut Solution, used: &[UsedFix], positions: &[AntennaPosition]) {
    let n = positions.len() as f64;
    let used_share = Solution::n_inliers(&solution.position_weights) as f64 / n.max(1.0);
    let growth = used_share.max(MIN_USED_SHARE).powi(-2);
    let (mut common, mut spread) = (Vector3::zeros(), Vector3::zeros());
    for (fix, position) in used.iter().zip(positions) {
        let [across, up] = fix.receiver.common_m();
        common += Vector3::new(across * across, across * across, up * up) / n;
        let residual = position.p_in_world - solution.poses[position.submap] * position.p_in_submap;
        let far_m = if used_share > 0.5 { FAR_M } else { f64::INFINITY };
        spread += residual.map(|off| off.abs().min(far_m).powi(2)) / n;
    }
    // Both horizontal axes alike, whatever the direction of the street.
    let across = (spread.x + spread.y) / 2.0;
    let spread_share = if used_share > 0.5 { SPREAD_SHARE } else { 1.0 };
    let variances = common + Vector3::new(across, across, spread.z) * spread_share;
    for (pose, covariance) in solution.poses.iter().zip(&mut solution.covariances) {
        *covariance *= growth;
        add_in_world(covariance, pose, &variances);
    }
}

fn add_in_world(covariance: &mut Matrix6<f64>, pose: &Pose, variances: &Vector3<f64>) {
    let axes = *pose.rotation.to_rotation_matrix().matrix();
    let in_submap = axes.transpose() * nalgebra::Matrix3::from_diagonal(variances) * axes;
    let mut block = covariance.fixed_view_mut::<3, 3>(0, 0);
    block += in_submap;
}
