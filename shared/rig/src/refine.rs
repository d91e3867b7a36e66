//! Refines a rig from its drive: rotations and delays of cameras and inertial unit, the delay of the receiver,
//! elevations of the LiDAR's rings, mountings of the secondary LiDARs, and by given paths the mounting of the first LiDAR.
//!
//! A value is replaced if the drive determines it and it differs by more than twice its standard deviation. All other
//! values are kept.

mod boresight;
mod cameras;
mod gnss;
mod imu;
mod rings;
mod secondary_lidars;

use crate::error::RigError;
use crate::survey::{Survey, SurveySettings};
use drive::Drive;
use drive::manifest::Manifest;
use drive::manifest::rules::MAX_DELAY_NANOS;
use serde::Serialize;
use std::fmt;

/// Number of standard deviations by which a value must differ.
pub(crate) const SIGNIFICANT: f64 = 2.0;

/// Outcome for a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The value is replaced.
    Replaced,
    /// The value is correct within its standard deviation.
    Kept,
    /// The drive does not determine it.
    NotObservable,
    /// The drive determines the value, but `drive.toml` has no entry for it.
    ToDo,
}

/// A value of the rig.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The sensor.
    pub subject: String,
    /// The value.
    pub quantity: String,
    /// Difference from the stated value, in `unit`.
    pub difference: f64,
    /// Standard deviation of the difference.
    pub sigma: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Outcome for the value.
    pub outcome: Outcome,
    /// Old and new value, or the reason why it is undetermined.
    pub text: String,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { subject, quantity, difference, sigma, unit, outcome, text } = self;
        let word = match outcome {
            Outcome::Replaced => "new",
            Outcome::Kept => "kept",
            Outcome::ToDo => "by hand",
            Outcome::NotObservable => return write!(f, "{:<14} {subject} {quantity}: {text}", "not observable"),
        };
        write!(f, "{word:<14} {subject} {quantity}: {difference:+.3} +- {sigma:.3} {unit}")?;
        if text.is_empty() { Ok(()) } else { write!(f, "; {text}") }
    }
}

/// A refined rig.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The new `drive.toml`.
    pub manifest: Manifest,
    /// Name and content of a calibration file of the LiDAR, to which the manifest refers.
    pub lidar_file: Option<(&'static str, String)>,
    /// All values.
    pub changes: Vec<Change>,
}

impl Refined {
    /// Refines the rig of a drive, which was surveyed with `settings`.
    pub fn from_survey(drive: &Drive, survey: &Survey, settings: &SurveySettings) -> Result<Self, RigError> {
        let mut refined = Self { manifest: drive.manifest().clone(), lidar_file: None, changes: Vec::new() };
        cameras::refine(drive, survey, &mut refined);
        imu::refine(survey, &mut refined);
        gnss::refine(survey, &mut refined);
        rings::refine(drive, survey, &mut refined);
        secondary_lidars::refine(drive, survey, settings, &mut refined)?;
        Ok(refined)
    }

    /// Whether any value is replaced.
    pub fn has_changes(&self) -> bool {
        self.changes.iter().any(|change| change.outcome == Outcome::Replaced)
    }
}

/// The delay of a sensor whose stamps are later than stated by `late_s`; `None` beyond the limit of `drive.toml`.
pub(crate) fn delayed(stated_nanos: i64, late_s: f64) -> Option<i64> {
    let new = stated_nanos.saturating_add((late_s * 1e9).round() as i64);
    (new.unsigned_abs() <= MAX_DELAY_NANOS).then_some(new)
}

/// Whether a difference is significant.
pub(crate) fn outcome(difference: f64, sigma: f64) -> Outcome {
    if difference.abs() > SIGNIFICANT * sigma { Outcome::Replaced } else { Outcome::Kept }
}
