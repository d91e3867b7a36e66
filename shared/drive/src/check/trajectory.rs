//! Rules for the entry of a post-processed trajectory.

use super::Check;
use crate::manifest::{TrajectoryEntry, TrajectoryFormat, rules};
use lidar::nmea;

/// Range of the longest interpolated time, s.
const MAX_GAPS_S: std::ops::RangeInclusive<f64> = 0.005..=10.0;
/// Largest stated deviations: beyond, a path is of no use.
const MAX_DEVIATION_M: f64 = 100.0;
const MAX_DEVIATION_DEG: f64 = 90.0;

impl Check<'_> {
    pub(super) fn trajectory(&mut self, entry: &TrajectoryEntry) {
        self.file("trajectory.file", &entry.file);
        for (key, name) in [("trajectory.deviations", &entry.deviations), ("trajectory.times", &entry.times)] {
            if let Some(name) = name {
                self.file(key, name);
            }
        }
        let format = entry.format;
        let is_sbet = format == TrajectoryFormat::Sbet;
        self.file.rule("trajectory.deviations", is_sbet || entry.deviations.is_none(), || {
            "is the SMRMSG of an SBET; remove it, or set trajectory.format = \"sbet\"".into()
        });
        let has_times = entry.times.is_some() == (format == TrajectoryFormat::Kitti);
        self.file.rule("trajectory.times", has_times, || {
            "is required for KITTI poses, and only for them: the other formats have times".into()
        });
        rules::pose(&mut self.file, "trajectory.body_from_reference", &entry.body_from_reference);
        rules::position(&mut self.file, "trajectory.body_from_reference", &entry.body_from_reference.translation);
        rules::delay(&mut self.file, "trajectory.delay_nanos", entry.delay_nanos);
        self.file.rule("trajectory.max_gap_s", MAX_GAPS_S.contains(&entry.max_gap_s), || {
            format!("value {} must be {} to {} s", entry.max_gap_s, MAX_GAPS_S.start(), MAX_GAPS_S.end())
        });
        if let Some(origin) = entry.origin {
            let [latitude, longitude, height] = origin;
            let on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 180.0 && height.abs() < 100_000.0;
            self.file.rule("trajectory.origin", on_earth, || {
                format!("value {origin:?} must be latitude -90 to 90, longitude -180 to 180 and height in m")
            });
        }
        let is_height = entry.geoid_m.is_none_or(|geoid_m| geoid_m.abs() <= nmea::MAX_GEOID_M);
        self.file.rule("trajectory.geoid_m", is_height, || {
            format!("value {:?} must be a height of the geoid above the ellipsoid, -200 to 200 m", entry.geoid_m)
        });
        for (key, values, limit) in [
            ("trajectory.deviation_m", entry.deviation_m, MAX_DEVIATION_M),
            ("trajectory.deviation_deg", entry.deviation_deg, MAX_DEVIATION_DEG),
        ] {
            let is_sound = values.iter().flatten().all(|value| *value > 0.0 && *value <= limit);
            self.file.rule(key, is_sound, || format!("value {values:?} must be above 0, up to {limit}"));
        }
    }
}
