//! Allowed ranges of the settings of a drive.

use settings::Rule;

/// A range of numbers, including both ends. NaN is outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    low: f64,
    high: f64,
}

/// Length of a drive, s. Forty minutes are 14 km of streets and 30 GB of drive with all cameras, 5 GB without.
pub const SECONDS: Limits = Limits { low: 0.2, high: 2400.0 };
/// Step of the lidar firings.
pub const LIDAR_STEP: Limits = Limits { low: 1.0, high: 100.0 };
/// Rotation errors of the mountings, degrees (standard deviation).
pub const CALIBRATION_ERROR_DEG: Limits = Limits { low: 0.0, high: 10.0 };
/// Translation errors of the mountings, cm (standard deviation).
pub const CALIBRATION_ERROR_CM: Limits = Limits { low: 0.0, high: 100.0 };
/// Exposure of the mosaic cameras, ms.
pub const MOSAIC_EXPOSURE_MS: Limits = Limits { low: 0.1, high: 1000.0 };

/// A value of a [`DriveSpec`](crate::DriveSpec) outside its limits.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: value {value} {rule}")]
pub struct OutOfLimits {
    /// The setting.
    pub key: &'static str,
    /// The value found.
    pub value: f64,
    /// The rule, "must be ...".
    pub rule: String,
}

impl Limits {
    /// Checks the value of `key`.
    pub(crate) fn check(&self, key: &'static str, value: f64) -> Result<(), OutOfLimits> {
        if self.allows(&value) { Ok(()) } else { Err(OutOfLimits { key, value, rule: self.text() }) }
    }
}

impl Rule<f64> for Limits {
    fn allows(&self, value: &f64) -> bool {
        settings::within(self.low, self.high).allows(value)
    }
    fn text(&self) -> String {
        settings::within(self.low, self.high).text()
    }
}
