//! Acceptance of a match.

use super::distant::is_distant;
use crate::Matched;
use geometry::Pose;

/// Least share of features with a match. At 10 m/s, 10 to 20 % lie on newly visible surfaces.
const MIN_MATCHED_SHARE: f64 = 0.3;
/// The share for distant sweeps, which see other surfaces and rings of the ground: muehlburger at 1 Hz and 10 m/s has 0.25.
const MIN_DISTANT_SHARE: f64 = 0.15;
/// Largest root mean square distance from the map's planes, m: five times the range noise.
const MAX_RMS_M: f64 = 0.12;
/// Largest difference from the prediction: 15 m/s^2 and 10 rad/s^2, more than any road vehicle reaches, plus the shift
/// of a coarse round.
const MAX_JUMP_MPS2: f64 = 15.0;
const MAX_JUMP_RADPS2: f64 = 10.0;
const JUMP_SLACK_M: f64 = 0.5;
const JUMP_SLACK_RAD: f64 = 0.05;

/// Whether a match has converged, with enough small residuals. The sweeps are `seconds` apart.
pub(super) fn is_plausible(matched: &Matched, seconds: f64) -> bool {
    let least_share = if is_distant(seconds) { MIN_DISTANT_SHARE } else { MIN_MATCHED_SHARE };
    let has_enough = matched.n_matches as f64 >= least_share * matched.n_features as f64;
    has_enough && matched.converged && matched.rms_m <= MAX_RMS_M
}

/// Whether a vehicle can reach the pose `mid`, `seconds` after the last one, instead of the predicted pose.
pub(super) fn is_reachable(mid: &Pose, predicted: &Pose, seconds: f64) -> bool {
    let jump_m = (mid.translation.vector - predicted.translation.vector).norm();
    let jump_rad = mid.rotation.angle_to(&predicted.rotation);
    let largest = largest_jump(seconds);
    jump_m <= largest.shift_m && jump_rad <= largest.turn_rad
}

/// A difference from a predicted pose.
pub(super) struct Jump {
    /// Shift, m.
    pub shift_m: f64,
    /// Turn, rad.
    pub turn_rad: f64,
}

/// The largest difference from a pose that was predicted `seconds` ahead.
pub(super) fn largest_jump(seconds: f64) -> Jump {
    let square = seconds * seconds;
    Jump { shift_m: JUMP_SLACK_M + MAX_JUMP_MPS2 * square, turn_rad: JUMP_SLACK_RAD + MAX_JUMP_RADPS2 * square }
}
