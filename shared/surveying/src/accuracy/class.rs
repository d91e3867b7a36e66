//! Accuracy classes of the ASPRS, edition 2 (2023).

use serde::{Deserialize, Serialize};
use std::fmt;

/// Least number of check points with which a product counts as tested.
pub const MIN_CHECK_POINTS: usize = 30;
/// Rounding errors of a root mean square, cm: an RMSE of exactly 5 cm is in the class of 5 cm.
const ROUNDING_CM: f64 = 1e-6;

/// The accuracy class of a result, in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AccuracyClass {
    /// Smallest class in whole cm that allows `rmse_m`.
    pub class_cm: u32,
    /// Root mean square error of the product, m: root of the sum of the squares of `measured_m` and `check_points_m`.
    pub rmse_m: f64,
    /// Root mean square of the residuals, m.
    pub measured_m: f64,
    /// Root mean square of the standard deviations of the check points, m.
    pub check_points_m: f64,
    /// Number of check points.
    pub n: usize,
    /// Number of check points that are missing for a tested product; 0: it is tested.
    pub n_missing: usize,
}

impl AccuracyClass {
    /// The class for this root mean square of the residuals, m, and the standard deviation of each check point in the
    /// direction of the class, m. `None` without check points.
    pub(super) fn new(measured_m: f64, sigmas_m: &[f64]) -> Option<Self> {
        let n = sigmas_m.len();
        if n == 0 {
            return None;
        }
        let check_points_m = (sigmas_m.iter().map(|sigma| sigma * sigma).sum::<f64>() / n as f64).sqrt();
        let rmse_m = measured_m.hypot(check_points_m);
        let n_missing = MIN_CHECK_POINTS.saturating_sub(n);
        Some(Self { class_cm: least_class_cm(rmse_m), rmse_m, measured_m, check_points_m, n, n_missing })
    }

    /// Whether at least [`MIN_CHECK_POINTS`] check points show it.
    pub fn is_tested(&self) -> bool {
        self.n_missing == 0
    }

    /// Whether the product counts as tested, in words.
    pub(super) fn test_text(&self) -> String {
        match self.n_missing {
            0 => format!("tested with {} check points", self.n),
            missing => format!("not tested: {} check points, {missing} are missing", self.n),
        }
    }
}

impl fmt::Display for AccuracyClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { class_cm, rmse_m, check_points_m, .. } = self;
        let test = self.test_text();
        write!(f, "{class_cm} cm (RMSE {rmse_m:.3} m, with {check_points_m:.3} m of the check points), {test}")
    }
}

/// Smallest class in whole cm, at least 1 cm, that allows a root mean square error in m.
pub(super) fn least_class_cm(rmse_m: f64) -> u32 {
    (rmse_m * 100.0 - ROUNDING_CM).ceil().clamp(1.0, f64::from(u32::MAX)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn class_needs_thirty_check_points_to_be_tested() {
        let class = |n: usize| AccuracyClass::new(0.04, &vec![0.03; n]).expect("has check points");
        assert_eq!((class(29).n_missing, class(29).is_tested()), (1, false));
        assert_eq!((class(30).n_missing, class(30).is_tested()), (0, true));
        // 3, 4 and 5 cm are a right triangle: the class is 5, not 6.
        assert_eq!(class(30).class_cm, 5);
        let text = "5 cm (RMSE 0.050 m, with 0.030 m of the check points), not tested: 29 check points, 1 are missing";
        assert_eq!(class(29).to_string(), text);
        assert!(class(40).to_string().ends_with("tested with 40 check points"));
        assert_eq!(AccuracyClass::new(0.04, &[]), None);
    }

    #[test]
    fn class_is_a_whole_number_of_centimetres() {
        for (rmse_m, class_cm) in [(0.0, 1), (0.01, 1), (0.010_001, 2), (0.024, 3), (1.0, 100), (1e12, u32::MAX)] {
            assert_eq!(least_class_cm(rmse_m), class_cm, "{rmse_m}");
        }
    }
}
