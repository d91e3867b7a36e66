//! Report of the auxiliary sensors at the end of a run.

use super::{AuxiliarySensors, LIDAR};
use crate::doubts::Doubts;
use crate::live::clocks::ClockEstimate;
use crate::live::images::CameraKind;
use lidar::LidarStats;
use lidar::nmea::LogStats;

/// A shorter run may lie between two fixes.
const MIN_SENSOR_NANOS: i64 = 2_000_000_000;

impl AuxiliarySensors {
    /// Counts the data that no sweep takes.
    pub fn discard_rest(&mut self) {
        if let Some(frames) = &mut self.frames {
            frames.discard_rest();
        }
    }

    /// One line for the clock of each sensor.
    pub fn clock_notes(&self) -> Vec<String> {
        let estimates = self.clocks.estimates();
        estimates.into_iter().map(|(name, estimate)| format!("clock of {name}: {estimate}")).collect()
    }

    /// Collects the doubts. `lidar`: counters of packets; `of_packets`: counters of the sentences in position packets; `has_secondary_lidars`:
    /// whether there are secondary LiDARs.
    pub fn doubt(&self, lidar: &LidarStats, of_packets: LogStats, has_secondary_lidars: bool, doubts: &mut Doubts) {
        let has_others =
            has_secondary_lidars || self.frames.is_some() || self.samples.is_some() || self.tally.fixes > 0;
        doubts.clock(lidar, has_others);
        doubts.files(&self.tally, 0, 0);
        doubts.log(&self.log_stats(of_packets), self.tally.gnss_rows, self.tally.fixes);
        if let Some(frames) = &self.frames {
            let counts = frames.counts();
            let n_frames = frames.n_recorded();
            doubts.outside(counts.before + counts.after, n_frames);
            doubts.late(counts.late, n_frames, self.limits.max_late_s);
        }
        self.doubt_clocks(doubts);
    }

    /// Cameras without an image, and logs without a measurement.
    pub fn silent_sensors(&self) -> Vec<String> {
        let mut sensors = Vec::new();
        if self.span.is_none_or(|[begin, end]| end - begin < MIN_SENSOR_NANOS) {
            return sensors;
        }
        let mut add = |kind: &str, name: &str, folder: &str, n: u64| {
            if n == 0 {
                sensors.push(format!("{kind} {name} (folder {folder} is empty)"));
            }
        };
        if let Some(frames) = &self.frames {
            for (index, entry) in self.entries.cameras.iter().enumerate() {
                add("camera", &entry.name, &entry.folder, frames.n_received(CameraKind::Color, index));
            }
            for (index, entry) in self.entries.mosaics.iter().enumerate() {
                add("mosaic", &entry.name, &entry.folder, frames.n_received(CameraKind::Mosaic, index));
            }
        }
        let logs =
            [("gnss", self.fixes.is_some(), self.tally.fixes), ("imu", self.samples.is_some(), self.tally.imu_samples)];
        sensors
            .extend(logs.into_iter().filter(|(_, is_read, n)| *is_read && *n == 0).map(|(name, ..)| name.to_owned()));
        sensors
    }

    /// Sensors whose clock differs from the clock of the first LiDAR. Images and sentences arrive later than they were
    /// measured, by an unknown delay: up to the limit of lateness it does not count as an offset.
    fn doubt_clocks(&self, doubts: &mut Doubts) {
        let estimates = self.clocks.estimates();
        let Some((_, lidar)) = estimates.iter().find(|(name, _)| *name == LIDAR) else { return };
        let limit = self.limits.max_clock_offset_s;
        for (name, ClockEstimate { offset_s, .. }) in &estimates {
            let behind_s = offset_s - lidar.offset_s;
            let is_soon = *name == "imu" || name.starts_with(LIDAR);
            let delay_s = if is_soon { 0.0 } else { self.limits.max_late_s };
            if behind_s < -limit || behind_s > limit + delay_s {
                doubts.clock_offset(name, behind_s, limit, delay_s);
            }
        }
    }
}
