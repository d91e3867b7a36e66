//! Doubts about the data of a drive: shares of damaged, foreign or missing data, against limits.

use doubts::Doubt;
use drive::Missing;
use formats::cloud_fields::{CloudForm, MapOrigin};
use lidar::LidarStats;
use lidar::nmea::LogStats;
use serde::{Deserialize, Serialize};

/// Blocks of a data packet.
const BLOCKS: f64 = lidar::velodyne::BLOCKS_PER_PACKET as f64;

/// Data that was published or not, since the start of the drive.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Tally {
    /// Images.
    pub images: Frames,
    /// Mosaics.
    pub mosaics: Frames,
    /// Samples of the IMU.
    pub imu_samples: u64,
    /// Damaged lines of the IMU.
    pub bad_imu_lines: u64,
    /// Fixes with a height.
    pub gnss_rows: u64,
    /// All fixes.
    pub fixes: u64,
}

/// Exposures of one kind of camera.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Frames {
    /// Files that were published.
    pub published: u64,
    /// Files that cannot be used.
    pub bad: u64,
}

impl Frames {
    /// Counts one file.
    pub fn add(&mut self, is_bad: bool) {
        *(if is_bad { &mut self.bad } else { &mut self.published }) += 1;
    }
}

/// Limits of damaged, foreign or missing data; shares of 1. The texts of doubts use these names.
#[derive(Clone, Copy, Debug)]
pub struct DoubtLimits {
    /// Largest share of damaged data.
    pub max_damaged_share: f64,
    /// Largest share of packets that are not the LiDAR's.
    pub max_foreign_share: f64,
    /// Largest share of exposures before the first or after the last sweep.
    pub max_outside_share: f64,
    /// Largest share of packets in which the clock of the LiDAR has no reference.
    pub max_unlocked_share: f64,
    /// Least share of GNSS epochs with position and height.
    pub min_fix_share: f64,
}

/// Collects doubts.
pub struct Doubts {
    limits: DoubtLimits,
    /// The secondary LiDAR of the doubts; `None`: they are about the first one, or about auxiliary sensors.
    lidar: Option<String>,
    found: Vec<Doubt>,
}

impl Doubts {
    /// An empty collection.
    pub fn new(limits: DoubtLimits) -> Self {
        Self { limits, lidar: None, found: Vec::new() }
    }

    /// An empty collection, about a secondary LiDAR.
    #[must_use]
    pub fn for_lidar(&self, name: &str) -> Self {
        Self { limits: self.limits, lidar: Some(name.to_owned()), found: Vec::new() }
    }

    /// Adds the doubts of another collection.
    pub fn add_all(&mut self, others: Self) {
        self.found.extend(others.found);
    }

    /// The doubts so far.
    pub fn found(self) -> Vec<Doubt> {
        self.found
    }

    fn add(&mut self, doubt: Doubt) {
        self.found.push(match &self.lidar {
            None => doubt,
            Some(lidar) => Doubt::SecondaryLidar { lidar: lidar.clone(), doubt: Box::new(doubt) },
        });
    }

    /// Adds the doubt about damaged data if its share is above the limit.
    fn add_damage(&mut self, share: f64, doubt: impl FnOnce(f64) -> Doubt) {
        let limit = self.limits.max_damaged_share;
        if share > limit {
            self.add(doubt(limit));
        }
    }

    /// Checks packets and captures. `n_bytes`: size of all captures.
    pub fn captures(&mut self, stats: &LidarStats, n_bytes: u64) {
        // Packets of a second source have a doubt of their own.
        let n_foreign = stats.foreign_packets - stats.second_source_packets + stats.short_packets;
        let n_packets = n_foreign + stats.data_packets + stats.position_packets;
        let foreign = share(n_foreign, n_packets);
        let limit = self.limits.max_foreign_share;
        if foreign > limit {
            self.add(Doubt::ForeignPackets { share: foreign, n_packets, limit });
        }
        let damaged = stats.late_packets as f64 + stats.bad_blocks as f64 / BLOCKS;
        let share = damaged / (stats.data_packets + stats.late_packets).max(1) as f64;
        self.add_damage(share, |limit| Doubt::DamagedPackets { share, limit });
        let share = stats.unread_bytes as f64 / n_bytes.max(1) as f64;
        self.add_damage(share, |limit| Doubt::UnreadCaptures { share, limit });
        if stats.cut_captures > 0 {
            self.add(Doubt::CutCaptures { n_captures: stats.cut_captures });
        }
        if stats.recorder_jumps > 0 {
            let largest_s = stats.recorder_jump_ms as f64 / 1000.0;
            self.add(Doubt::RecorderClock { n_jumps: stats.recorder_jumps, largest_s });
        }
        if stats.source_changes > 0 {
            let silent_s = stats.source_silent_ms as f64 / 1000.0;
            self.add(Doubt::SourceChanged { n_changes: stats.source_changes, silent_s });
        }
        if stats.second_source_packets > 0 {
            self.add(Doubt::SecondSource { n_packets: stats.second_source_packets });
        }
        if stats.clocks_set_back > 0 {
            self.add(Doubt::ClocksSetBack {
                n_steps: stats.clocks_set_back,
                back_s: stats.set_back_ms as f64 / 1000.0,
            });
        }
    }

    /// Checks the numbers of the files of a LiDAR.
    pub fn numbers(&mut self, missing: &Missing) {
        if let Some(first) = missing.texts.first() {
            self.add(Doubt::MissingFiles { n_files: missing.n_files, first: first.clone() });
        }
    }

    /// Checks how the cloud files of a LiDAR are read.
    pub fn clouds(&mut self, form: &CloudForm) {
        if let Some(MapOrigin(origin)) = form.origin {
            self.add(Doubt::MapCoordinates { origin });
        }
        if let Some(field) = &form.unread_times {
            self.add(Doubt::UnreadPointTimes { field: field.clone() });
        }
    }

    /// Checks the clock of the LiDAR. `others`: whether measurements of other sensors were matched to sweeps by their
    /// stamps.
    pub fn clock(&mut self, stats: &LidarStats, others: bool) {
        let n_states = stats.clock_locked + stats.clock_unlocked;
        let share = share(stats.clock_unlocked, n_states);
        let limit = self.limits.max_unlocked_share;
        if others && share > limit {
            self.add(Doubt::PpsNotLocked { share, n_states, limit });
        }
    }

    /// Checks the sentences of a GNSS receiver. `n_used` of `n_fixes` have a height.
    pub fn log(&mut self, log: &LogStats, n_used: u64, n_fixes: u64) {
        let n_lines = log.sentences + log.other_sentences + log.bad_lines;
        let damaged = share(log.bad_lines, n_lines);
        let first = log.first_bad.clone().unwrap_or_default();
        self.add_damage(damaged, |limit| Doubt::BadNmeaLines { share: damaged, limit, first });
        if log.conflicting > 0 || log.alternating > 0 {
            let LogStats { conflicting: n_epochs, alternating: n_alternating, .. } = *log;
            self.add(Doubt::TwoReceivers { n_epochs, n_alternating, apart_m: log.apart_mm as f64 / 1000.0 });
        }
        let n_epochs = n_fixes + log.without_fix + log.out_of_order + log.undated + log.null_islands;
        let share = share(n_used, n_epochs);
        let limit = self.limits.min_fix_share;
        if log.sentences > 0 && share < limit {
            self.add(Doubt::FewFixes { share, n_epochs, limit, reasons: log.left_out() });
        }
    }

    /// Files and lines that cannot be used.
    pub fn files(&mut self, tally: &Tally, n_sweeps: u64, n_bad_sweeps: u64) {
        let share_of = |frames: &Frames| share(frames.bad, frames.bad + frames.published);
        let images = share_of(&tally.images);
        self.add_damage(images, |limit| Doubt::BadImages { share: images, limit });
        let mosaics = share_of(&tally.mosaics);
        self.add_damage(mosaics, |limit| Doubt::BadMosaics { share: mosaics, limit });
        let lines = share(tally.bad_imu_lines, tally.bad_imu_lines + tally.imu_samples);
        self.add_damage(lines, |limit| Doubt::BadImuLines { share: lines, limit });
        self.sweeps(n_bad_sweeps, n_sweeps);
    }

    /// Cloud files that cannot be read.
    pub fn sweeps(&mut self, n_bad: u64, n_sweeps: u64) {
        let share = share(n_bad, n_sweeps);
        self.add_damage(share, |limit| Doubt::BadSweeps { share, limit });
    }

    /// Sweeps of the first LiDAR during which a secondary LiDAR has no returns.
    pub fn missing_sweeps(&mut self, n_missing: u64, n_sweeps: u64) {
        let share = share(n_missing, n_sweeps);
        self.add_damage(share, |limit| Doubt::MissingSweeps { share, limit });
    }

    /// Exposures before the first or after the last sweep.
    pub fn outside(&mut self, n_outside: u64, n_frames: u64) {
        let share = share(n_outside, n_frames);
        let limit = self.limits.max_outside_share;
        if share > limit {
            self.add(Doubt::ExposuresOutside { share, n_frames, limit });
        }
    }

    /// Live: packets that gave no sweep.
    pub fn no_sweep(&mut self, n_packets: u64) {
        self.add(Doubt::NoSweep { n_packets });
    }

    /// Live: exposures that arrived more than `max_late_s` after the sweep of their time.
    pub fn late(&mut self, n_late: u64, n_frames: u64, max_late_s: f64) {
        let share = share(n_late, n_frames);
        let limit = self.limits.max_outside_share;
        if share > limit {
            self.add(Doubt::LateExposures { share, n_frames, max_late_s, limit });
        }
    }

    /// Live: the clock of a sensor is behind the clock of the LiDAR by this time, of which `delay_s` may be
    /// transmission.
    pub fn clock_offset(&mut self, sensor: &str, behind_s: f64, limit_s: f64, delay_s: f64) {
        self.add(Doubt::ClockOffset { sensor: sensor.to_owned(), behind_s, limit_s, delay_s });
    }

    /// Sensors of the manifest without data.
    pub fn silent(&mut self, sensors: &[String]) {
        if !sensors.is_empty() {
            self.add(Doubt::SilentSensors { sensors: sensors.to_vec() });
        }
    }
}

/// The quotient of `part` and `whole`; 0 if `whole` is 0.
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}
