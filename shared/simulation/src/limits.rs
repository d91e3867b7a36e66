//! Allowed ranges of the settings of a drive.

use std::fmt;

/// A range of numbers, both ends included.
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

/// Why a value of a setting is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// The value breaks the rule of the setting.
    #[error("{key}: value {value} {rule}")]
    Rule {
        /// The setting.
        key: &'static str,
        /// The value found.
        value: String,
        /// The rule, "must be ...".
        rule: String,
    },
    /// The value has another type.
    #[error("{key}: {problem}")]
    Type {
        /// The setting.
        key: &'static str,
        /// The value found and the type expected.
        problem: String,
    },
}

impl SettingError {
    /// The message without the key, for callers that show the key themselves.
    pub fn text(&self) -> String {
        match self {
            Self::Rule { value, rule, .. } => format!("value {value} {rule}"),
            Self::Type { problem, .. } => problem.clone(),
        }
    }
}

impl Limits {
    /// Returns the value if it is within the range. NaN is outside.
    pub fn check(&self, key: &'static str, value: f64) -> Result<f64, SettingError> {
        if value >= self.low && value <= self.high {
            return Ok(value);
        }
        Err(SettingError::Rule { key, value: value.to_string(), rule: self.to_string() })
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "must be between {} and {}", self.low, self.high)
    }
}
