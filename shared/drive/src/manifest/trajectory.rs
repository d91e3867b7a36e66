//! A post-processed trajectory: the path of the vehicle from another program.

use super::{PoseEntry, is_zero};
use serde::{Deserialize, Serialize};

/// Longest time between two poses that is interpolated by default, s: at 3 m/s², the middle is 1.5 cm off.
const DEFAULT_MAX_GAP_S: f64 = 0.2;

/// The table `[trajectory]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryEntry {
    /// File of the poses.
    pub file: String,
    /// Format of the file.
    pub format: TrajectoryFormat,
    /// SMRMSG file with the standard deviations of an SBET.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviations: Option<String>,
    /// File with the times of KITTI poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<String>,
    /// Clock of the times. Without it: `gps` for SBET, `NovAtel` and seconds of a week, `utc` for TUM, KITTI and dates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// GPS week of seconds of a week. Without it: the week of the drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gps_week: Option<u32>,
    /// Frame of the places: `geodetic` (WGS84), `local`, or `EPSG:` with the number of a UTM zone. Without it: as the format or
    /// the columns say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// Latitude, longitude (degrees) and ellipsoidal height (m) of the origin of a local frame with axes east, north, up. Without
    /// it, a local frame is not georeferenced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// Height of the geoid above the ellipsoid, m, for files with heights above the geoid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geoid_m: Option<f64>,
    /// Sense of headings.
    #[serde(default, skip_serializing_if = "is_default")]
    pub heading: HeadingSense,
    /// The reference point of the export, with axes forward, left and up, in the body.
    #[serde(default = "identity", skip_serializing_if = "is_identity")]
    pub body_from_reference: PoseEntry,
    /// Delay of the stamps relative to the measurement, ns. Subtracted from all stamps.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub delay_nanos: i64,
    /// Longest time between two poses that is interpolated, s.
    #[serde(default = "default_max_gap_s", skip_serializing_if = "is_default_max_gap")]
    pub max_gap_s: f64,
    /// Standard deviations towards east, north and up, m, if no file states them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation_m: Option<[f64; 3]>,
    /// Standard deviations of roll, pitch and heading, degrees, if no file states them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation_deg: Option<[f64; 3]>,
}

/// Format of a trajectory file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrajectoryFormat {
    /// Applanix.
    Sbet,
    /// `NovAtel` INSPVA, INSPVAS, INSPVAX; text or binary.
    Novatel,
    /// Named columns, as of Inertial Explorer.
    Table,
    /// Seconds, position, quaternion.
    Tum,
    /// Matrices, with `times`.
    Kitti,
}

/// Clock of the times of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// GPS time: seconds of the week, or since 1980-01-06.
    Gps,
    /// UTC: seconds of the week, or since 1970-01-01.
    Utc,
    /// Seconds of the day, GPS time.
    GpsDay,
    /// Seconds of the day, UTC.
    UtcDay,
}

/// Sense of headings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeadingSense {
    /// A compass: north 0, east 90 degrees.
    #[default]
    ClockwiseFromNorth,
    /// A mathematical angle: east 0, north 90 degrees.
    CounterclockwiseFromEast,
    /// North 0, west 90 degrees.
    CounterclockwiseFromNorth,
}

const fn identity() -> PoseEntry {
    PoseEntry::IDENTITY
}

fn is_identity(pose: &PoseEntry) -> bool {
    *pose == PoseEntry::IDENTITY
}

const fn default_max_gap_s() -> f64 {
    DEFAULT_MAX_GAP_S
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde defines the signature")]
fn is_default_max_gap(value: &f64) -> bool {
    *value == DEFAULT_MAX_GAP_S
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde defines the signature")]
fn is_default(value: &HeadingSense) -> bool {
    *value == HeadingSense::default()
}

impl TrajectoryEntry {
    /// Entry of a file with the defaults of its format.
    pub fn new(file: &str, format: TrajectoryFormat) -> Self {
        Self {
            file: file.to_owned(),
            format,
            deviations: None,
            times: None,
            clock: None,
            gps_week: None,
            frame: None,
            origin: None,
            geoid_m: None,
            heading: HeadingSense::default(),
            body_from_reference: PoseEntry::IDENTITY,
            delay_nanos: 0,
            max_gap_s: DEFAULT_MAX_GAP_S,
            deviation_m: None,
            deviation_deg: None,
        }
    }
}
