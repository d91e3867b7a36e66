//! Standard deviations of the result in excess of the least-squares covariance: common errors of the fixes, and their
//! disagreement.

use crate::fixes::UsedFix;
use crate::lasting_error::LastingError;
use crate::median::median;
use crate::{AntennaPosition, Solution};
use geometry::Pose;
use nalgebra::{Matrix3, Matrix6, Vector3};

/// A fix agrees with the result within this many times its tolerance horizontally, as in [`crate::PoseGraph::solve`],
/// and within `MAX_UP` times in height, where multipath is larger.
const MAX_ACROSS: f64 = 3.4;
const MAX_UP: f64 = 12.0;
/// Lower bound for the share of agreeing fixes in the growth of standard deviations.
const MIN_USED_SHARE: f64 = 0.05;
/// Below this share of agreeing fixes, the result may be at any of the fixes.
const MAJORITY: f64 = 0.5;

/// Numbers of the fixes that agree with these poses if they are the majority; otherwise the numbers of all fixes. Near
/// a jump all fixes appear to drift, so their deviations do not identify the wrong ones.
pub(crate) fn majority(used: &[UsedFix], positions: &[AntennaPosition], poses: &[Pose]) -> Vec<usize> {
    let all = 0..positions.len();
    let agreeing: Vec<usize> =
        all.clone().filter(|&number| agrees(&used[number], &residual(&positions[number], poses))).collect();
    let most_agree = agreeing.len() as f64 > (1.0 - MAJORITY) * positions.len() as f64;
    if most_agree { agreeing } else { all.collect() }
}

pub(crate) fn residual(position: &AntennaPosition, poses: &[Pose]) -> Vector3<f64> {
    position.p_in_world - poses[position.submap] * position.p_in_submap
}

fn agrees(fix: &UsedFix, residual: &Vector3<f64>) -> bool {
    let tolerance_m = fix.tolerance_m();
    residual.xy().norm() <= MAX_ACROSS * tolerance_m && residual.z.abs() <= MAX_UP * tolerance_m
}

/// Rejects fixes that do not agree with the result, regardless of their weight, lowers the poses by the usual height error of lasting
/// errors, and adds common errors to the covariances of placed submaps. Common errors grow with the share of rejected fixes; if it
/// is above one half, standard deviations grow by the median distance of all fixes.
pub(crate) fn judge(solution: &mut Solution, used: &[UsedFix], positions: &[AntennaPosition]) {
    let n = positions.len() as f64;
    let mut common = Vector3::zeros();
    let mut across_m = Vec::new();
    let mut up_m = Vec::new();
    for (number, (fix, position)) in used.iter().zip(positions).enumerate() {
        let residual = residual(position, &solution.poses);
        if !agrees(fix, &residual) {
            solution.position_weights[number] = 0.0;
        }
        let [across, up] = fix.common_m();
        common += Vector3::new(across * across, across * across, up * up) / n;
        across_m.push(residual.xy().norm());
        up_m.push(residual.z.abs());
    }
    let lasting = LastingError::new(used, positions, &solution.poses);
    let used_share = Solution::n_inliers(&solution.position_weights) as f64 / n.max(1.0);
    let growth = used_share.max(MIN_USED_SHARE).powi(-2);
    let mut variances = common * growth + lasting.variances();
    if used_share < MAJORITY {
        // Both axes share the horizontal distance.
        let across = median(across_m).unwrap_or(0.0).powi(2) / 2.0;
        let up = median(up_m).unwrap_or(0.0).powi(2);
        variances += Vector3::new(across, across, up);
    }
    for (pose, covariance) in solution.poses.iter_mut().zip(&mut solution.covariances) {
        add_in_world(covariance, pose, &variances);
        pose.translation.z -= lasting.raised_m();
    }
}

fn add_in_world(covariance: &mut Matrix6<f64>, pose: &Pose, variances: &Vector3<f64>) {
    let axes = *pose.rotation.to_rotation_matrix().matrix();
    let in_submap = axes.transpose() * Matrix3::from_diagonal(variances) * axes;
    let mut block = covariance.fixed_view_mut::<3, 3>(0, 0);
    block += in_submap;
}
