//! The error that all fixes of a drive share because their errors last: reflections of one street, or the filter of the receiver.
//!
//! A residual is the error of a fix without the shared part, so the shared part cannot be seen. Its size can: errors that last for `tau`
//! (a Gauss-Markov process) and are seen for the time T leave a mean with a share of their variance that follows from T / tau. Half of
//! the fixes, the better ones, decide the result, so the median of the residuals measures the errors, not their mean.

use crate::AntennaPosition;
use crate::deviations::residual;
use crate::fixes::UsedFix;
use crate::median::median;
use crate::receiver_errors::independent_noise;
use crate::receiver_filter::FixResidual;
use geometry::{Pose, Vector3};

/// Time in which the errors change, s: the memory of the simulated receiver, and the time in which a vehicle passes some houses.
const LASTING_S: f64 = 15.0;
/// Drive time at which the factors below hold, s.
const FITTED_S: f64 = 60.0;
/// Standard deviation of the shared error, along one horizontal axis and in height, and the mean height error, in units of the median
/// residual along one axis. Fitted by the likelihood of 85 drives of 60 s (seeds 20001 to 20085 and 770 to 780).
const ACROSS_PER_RESIDUAL: f64 = 0.65;
const UP_PER_RESIDUAL: f64 = 1.1;
const RAISED_PER_RESIDUAL: f64 = 1.0;
/// Largest mean height error that is corrected, m.
const MAX_RAISED_M: f64 = 2.0;
/// Median of the length of a vector with independent normal components of deviation 1.
const RAYLEIGH_MEDIAN: f64 = 1.177;

/// Size of the lasting errors of a drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LastingError {
    /// Median residual along one horizontal axis, without independent noise, m.
    residual_m: f64,
    /// Time in which the surroundings of the antenna changed, s.
    passed_s: f64,
}

impl LastingError {
    /// Measures the errors of the fixes of a drive. Errors of carrier phases do not come from reflections.
    pub fn new(used: &[UsedFix], positions: &[AntennaPosition], poses: &[Pose]) -> Self {
        let residuals: Vec<FixResidual> = used
            .iter()
            .zip(positions)
            .filter(|(fix, _)| !fix.receiver.is_by_carrier())
            .map(|(fix, position)| FixResidual { stamp: fix.stamp, residual: residual(position, poses) })
            .collect();
        let noise = independent_noise(&residuals);
        let across_m = median(residuals.iter().map(|fix| fix.residual.xy().norm())).unwrap_or(0.0) / RAYLEIGH_MEDIAN;
        let noise_m = noise.x.max(noise.y);
        let residual_m = (across_m.powi(2) - noise_m.powi(2)).max(0.0).sqrt();
        Self { residual_m, passed_s: used.iter().map(|fix| fix.passing_s(0.0)).sum() }
    }

    /// Variances of the shared error to east, north and up, m^2.
    pub fn variances(&self) -> Vector3<f64> {
        let growth = self.growth();
        let [across, up] = [ACROSS_PER_RESIDUAL, UP_PER_RESIDUAL].map(|k| (k * self.residual_m).powi(2) * growth);
        Vector3::new(across, across, up)
    }

    /// Mean height error of the result, m.
    pub fn raised_m(&self) -> f64 {
        (RAISED_PER_RESIDUAL * self.residual_m * self.growth().sqrt()).min(MAX_RAISED_M)
    }

    /// Growth of the variance for this drive time: a longer drive has more streets, and fixes without reflections.
    fn growth(&self) -> f64 {
        // A size that is measured on few independent errors may be too small.
        let unsure = |seconds: f64| 1.0 + LASTING_S / seconds.max(1.0);
        let of = |seconds| odds_of_mean(seconds) * unsure(seconds);
        of(self.passed_s) / of(FITTED_S)
    }
}

/// Variance of the mean of a Gauss-Markov process over this time, divided by its variance around that mean.
fn odds_of_mean(seconds: f64) -> f64 {
    let times = (seconds / LASTING_S).max(0.05);
    let mean = 2.0 / times * (1.0 - (1.0 - (-times).exp()) / times);
    mean / (1.0 - mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Point3};

    /// The lasting error of fixes at 1 Hz with these errors towards east and north.
    fn lasting(n: i64, by_carrier: bool, error: impl Fn(i64) -> [f64; 2]) -> LastingError {
        let used: Vec<UsedFix> = (0..n).map(|second| UsedFix::for_test(second, 1.0, by_carrier)).collect();
        let position = |second: i64| {
            let [east, north] = error(second);
            AntennaPosition {
                submap: 0,
                p_in_submap: Point3::origin(),
                p_in_world: Point3::new(east, north, 0.0),
                sigma_m: [0.3; 3],
                sigma_above_m: 0.3,
                share: 1.0,
                tolerance_m: 0.6,
            }
        };
        let positions: Vec<AntennaPosition> = (0..n).map(position).collect();
        LastingError::new(&used, &positions, &[Isometry3::identity()])
    }

    fn circle(second: i64) -> [f64; 2] {
        let angle = second as f64 * 0.1;
        [2.0 * angle.cos(), 2.0 * angle.sin()]
    }

    #[test]
    fn errors_that_last_are_shared_and_raise_the_result_but_noise_does_not() {
        let found = lasting(60, false, circle);
        assert!((found.residual_m - 2.0 / RAYLEIGH_MEDIAN).abs() < 0.05, "{found:?}");
        assert!(found.raised_m() > 1.0 && found.raised_m() <= MAX_RAISED_M);
        for stream in 0..20 {
            let gauss =
                |second: i64, axis| f64::from(random::gauss(random::hash(random::hash(stream, axis), second as u64)));
            let noise = lasting(120, false, |second| [gauss(second, 0), gauss(second, 1)]);
            assert!(noise.residual_m < 0.5, "{stream}: {noise:?}");
        }
    }

    #[test]
    fn shared_error_is_smaller_for_longer_drives_and_none_for_carrier_phases() {
        let [short, minute, long] = [15, 60, 300].map(|n| lasting(n, false, circle).growth());
        assert!(short > 2.0 * minute && long < 0.3 * minute, "{short} {minute} {long}");
        let carrier = lasting(60, true, circle);
        assert_eq!(carrier.variances(), Vector3::zeros());
        assert!(carrier.raised_m() <= 0.0);
    }

    /// The share of the variance of a Gauss-Markov process that its mean over a time keeps, against a sum over its correlation.
    #[test]
    fn mean_of_a_process_keeps_the_variance_of_its_correlation() {
        for seconds in [15, 60, 300] {
            let n = 10 * seconds;
            let correlation = |a: i32, b: i32| (-f64::from((a - b).abs()) / 10.0 / LASTING_S).exp();
            let mean = (0..n).flat_map(|a| (0..n).map(move |b| correlation(a, b))).sum::<f64>() / f64::from(n * n);
            let expected = mean / (1.0 - mean);
            assert!((odds_of_mean(f64::from(seconds)) / expected - 1.0).abs() < 0.01, "{seconds} s");
        }
    }
}
