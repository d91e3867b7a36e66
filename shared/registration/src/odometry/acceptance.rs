//! Acceptance of a match.

use crate::Matched;
use geometry::Pose;

/// Least share of features with a match. At 10 m/s, 10 to 20 % lie on newly visible surfaces.
const MIN_MATCHED_SHARE: f64 = 0.3;
/// Largest root mean square distance from the map's planes, m: five times the range noise.
const MAX_RMS_M: f64 = 0.12;
/// Largest difference from the prediction: 15 m/s^2 and 10 rad/s^2, more than any road vehicle reaches, plus the shift
/// of a coarse round.
const MAX_JUMP_MPS2: f64 = 15.0;
const MAX_JUMP_RADPS2: f64 = 10.0;
const JUMP_SLACK_M: f64 = 0.5;
const JUMP_SLACK_RAD: f64 = 0.05;

/// Whether a match has converged, with enough small residuals.
pub(super) fn is_plausible(matched: &Matched) -> bool {
    let has_enough = matched.n_matches as f64 >= MIN_MATCHED_SHARE * matched.n_features as f64;
    has_enough && matched.converged && matched.rms_m <= MAX_RMS_M
}

/// Whether a vehicle can reach the pose `mid`, `seconds` after the last one, instead of the predicted pose.
pub(super) fn is_reachable(mid: &Pose, predicted: &Pose, seconds: f64) -> bool {
    let jump_m = (mid.translation.vector - predicted.translation.vector).norm();
    let jump_rad = mid.rotation.angle_to(&predicted.rotation);
    let square = seconds * seconds;
    jump_m <= JUMP_SLACK_M + MAX_JUMP_MPS2 * square && jump_rad <= JUMP_SLACK_RAD + MAX_JUMP_RADPS2 * square
}
