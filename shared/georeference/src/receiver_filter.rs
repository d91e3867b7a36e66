//! The smoothing filter inside some GNSS receivers, and its inversion.
//!
//! Such a receiver predicts its position with the measured speed and corrects the prediction slightly with each new
//! fix. A fix under the open sky then still contains the errors of the previous street. Only the simulated receiver is
//! known to work in this manner, so the inversion is off unless [`crate::GeoreferenceSettings::unsmooth_fixes`] is set.

use crate::AntennaPosition;
use crate::median::median;
use geometry::Vector3;

/// Gain of the filter, 1/s, at a dilution of 1; smaller at a larger dilution. Gains of 0.12 to 0.17 perform equally
/// well over the fixes of seeds 21 to 34.
pub(crate) const GAIN_PER_S: f64 = 0.14;
/// Error of the measured speed at a dilution of 1, m/s. The filter integrates it, and the inversion amplifies it.
pub(crate) const SPEED_ERROR_MPS: f64 = 0.03;
/// Largest error of an unsmoothed position due to the speed, m: as large as errors from reflections. It limits the
/// amplification from a dilution of 3 on, where some of the filter's memory remains.
pub(crate) const MAX_NOISE_M: f64 = 2.0;
/// A smoothing receiver has steps between residuals below this share of the residuals.
const MAX_STEP_SHARE: f64 = 0.5;
/// Largest share of steps that reverse: half for a filter, 0.7 for noise on a slowly changing error.
const MAX_REVERSALS: f64 = 0.6;
/// Up to this dilution the reported standard deviations are valid for unsmoothed positions.
const MAX_RELIABLE_HDOP: f64 = 2.0;

/// Difference between a fix and the position of the antenna by the submaps.
#[derive(Clone, Copy)]
pub struct FixResidual {
    pub stamp: i64,
    /// World axes, m.
    pub residual: Vector3<f64>,
}

/// Whether the receiver smooths, judged from the residuals of its fixes relative to the submaps. Steps between
/// independent errors are 1.4 times as long as the errors; the steps of the simulated receiver are 0.15 to 0.2 times as
/// long. A slowly changing error also has short steps, but the steps of the noise on it reverse.
pub fn is_smoothed(residuals: &[FixResidual]) -> bool {
    let center = [0, 1].map(|axis| median(residuals.iter().map(|fix| fix.residual[axis])).unwrap_or(0.0));
    let errors = residuals.iter().map(|fix| (fix.residual.x - center[0]).hypot(fix.residual.y - center[1]));
    let steps: Vec<_> = residuals.windows(2).map(|pair| (pair[1].residual - pair[0].residual).xy()).collect();
    let n_reversals = steps.windows(2).filter(|pair| pair[0].dot(&pair[1]) < 0.0).count();
    let reverses = n_reversals as f64 > MAX_REVERSALS * (steps.len() as f64 - 1.0);
    let [step, error] = [median(steps.iter().map(nalgebra::Matrix::norm)), median(errors)].map(|of| of.unwrap_or(0.0));
    step < MAX_STEP_SHARE * error && !reverses
}

/// Inverts one step of the filter: moves the position to the fix that corrected the filter. `change` is the change of
/// the residual since the fix `seconds` before.
pub fn unsmooth(position: &mut AntennaPosition, change: &Vector3<f64>, seconds: f64, hdop: f64) {
    let kept = (-seconds * GAIN_PER_S / hdop).exp();
    let amplification = (kept / (1.0 - kept)).min(MAX_NOISE_M / (SPEED_ERROR_MPS * hdop));
    let onward = change * amplification;
    position.p_in_world.x += onward.x;
    position.p_in_world.y += onward.y;
    // Without the limit the amplification is about the dilution over the gain.
    let noise = (amplification * seconds * GAIN_PER_S / MAX_RELIABLE_HDOP).max(1.0);
    let [east, north, _] = &mut position.sigma_m;
    *east *= noise;
    *north *= noise;
}
