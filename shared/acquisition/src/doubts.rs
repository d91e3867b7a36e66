//! How far the data of a drive can be trusted: shares of what is damaged, foreign or missing, against limits.

use lidar::LidarStats;
use lidar::nmea::LogStats;
use serde::{Deserialize, Serialize};

/// Blocks of a data packet.
const BLOCKS: f64 = lidar::velodyne::BLOCKS_PER_PACKET as f64;

/// What was published and what was not, since the begin of the drive.
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

/// Limits of what is damaged, foreign or missing; shares of 1. Texts name them as here.
#[derive(Clone, Copy, Debug)]
pub struct DoubtLimits {
    /// Largest share of damaged data.
    pub max_damaged_share: f64,
    /// Largest share of packets that are not the LiDAR's.
    pub max_foreign_share: f64,
    /// Largest share of exposures before the first or after the last sweep.
    pub max_outside_share: f64,
    /// Largest share of packets by which the clock of the LiDAR has no reference.
    pub max_unlocked_share: f64,
    /// Least share of GNSS epochs with position and height.
    pub min_fix_share: f64,
}

/// One reason not to rely on the data.
#[derive(Clone, Debug)]
pub struct Doubt {
    /// Name of the doubt; of a LiDAR after the first, with the name of the LiDAR at its end.
    pub name: String,
    /// The value that exceeds its limit.
    pub size: f64,
    /// Explanation for the operator.
    pub text: String,
}

/// Collects doubts.
pub struct Doubts {
    limits: DoubtLimits,
    /// The LiDAR that they are about, if it is not the first.
    lidar: Option<String>,
    found: Vec<Doubt>,
}

impl Doubts {
    /// None yet.
    pub fn new(limits: DoubtLimits) -> Self {
        Self { limits, lidar: None, found: Vec::new() }
    }

    /// None yet, about a LiDAR after the first.
    #[must_use]
    pub fn of_lidar(&self, name: &str) -> Self {
        Self { limits: self.limits, lidar: Some(name.to_owned()), found: Vec::new() }
    }

    /// Adds the doubts of others.
    pub fn add_all(&mut self, others: Self) {
        self.found.extend(others.found);
    }

    /// The doubts so far.
    pub fn found(self) -> Vec<Doubt> {
        self.found
    }

    fn add(&mut self, name: &'static str, size: f64, text: String) {
        let doubt = match &self.lidar {
            None => Doubt { name: name.to_owned(), size, text },
            Some(lidar) => Doubt { name: format!("{name}_{lidar}"), size, text: format!("LiDAR {lidar}: {text}") },
        };
        self.found.push(doubt);
    }

    /// Packets and captures. `n_bytes`: size of all captures.
    pub fn captures(&mut self, stats: &LidarStats, n_bytes: u64) {
        let others = stats.foreign_packets + stats.short_packets;
        let n_packets = others + stats.data_packets + stats.position_packets;
        let (share, limit) = (share(others, n_packets), self.limits.max_foreign_share);
        if share > limit {
            let text = format!(
                "{} of the {n_packets} packets are foreign or too short, more than max_foreign_share = {limit}; check that \
                 the sweeps are those of the right sensor",
                percent(share)
            );
            self.add("foreign_packets", share, text);
        }
        let damaged = stats.late_packets as f64 + stats.bad_blocks as f64 / BLOCKS;
        let share = damaged / (stats.data_packets + stats.late_packets).max(1) as f64;
        self.damaged("damaged_packets", share, "of the LiDAR's packets arrived too late or have undecodable blocks");
        let share = stats.unread_bytes as f64 / n_bytes.max(1) as f64;
        self.damaged("unread_captures", share, "of the bytes of the captures lie behind damage and are not read");
        if stats.cut_captures > 0 {
            let text = format!(
                "{} capture(s) end inside a packet: the recorder did not finish them, and an unknown part of the drive is missing",
                stats.cut_captures
            );
            self.add("cut_captures", stats.cut_captures as f64, text);
        }
    }

    /// The clock of the LiDAR. `others`: whether measurements of other sensors were matched to sweeps by their stamps.
    pub fn clock(&mut self, stats: &LidarStats, others: bool) {
        let n_states = stats.clock_locked + stats.clock_unlocked;
        let (share, limit) = (share(stats.clock_unlocked, n_states), self.limits.max_unlocked_share);
        if others && share > limit {
            let text = format!(
                "in {} of the {n_states} packets that tell it, the clock of the LiDAR follows neither PPS nor PTP, more than \
                 max_unlocked_share = {limit}; stamps of the other sensors may be those of another clock",
                percent(share)
            );
            self.add("pps_not_locked", share, text);
        }
    }

    /// Sentences of a GNSS receiver. `n_used` of `n_fixes` have a height.
    pub fn log(&mut self, log: &LogStats, n_used: u64, n_fixes: u64) {
        let n_lines = log.sentences + log.other_sentences + log.bad_lines;
        self.damaged("bad_nmea_lines", share(log.bad_lines, n_lines), "of the NMEA lines are damaged");
        let n_epochs = n_fixes + log.without_fix + log.out_of_order;
        let (share, limit) = (share(n_used, n_epochs), self.limits.min_fix_share);
        if log.sentences > 0 && share < limit {
            let text = format!(
                "only {} of the {n_epochs} GNSS epochs have position and height, less than min_fix_share = {limit}; the \
                 receiver must log GGA and RMC sentences",
                percent(share)
            );
            self.add("few_fixes", share, text);
        }
    }

    /// Files and lines that cannot be used.
    pub fn files(&mut self, tally: &Tally, n_sweeps: u64, n_bad_sweeps: u64) {
        let share_of = |frames: &Frames| share(frames.bad, frames.bad + frames.published);
        self.damaged("bad_images", share_of(&tally.images), "of the images are damaged or have the wrong size");
        self.damaged("bad_mosaics", share_of(&tally.mosaics), "of the mosaics are damaged or have the wrong size");
        let n_lines = tally.bad_imu_lines + tally.imu_samples;
        self.damaged(
            "bad_imu_lines",
            share(tally.bad_imu_lines, n_lines),
            "of the IMU lines are damaged or impossible",
        );
        self.sweeps(n_bad_sweeps, n_sweeps);
    }

    /// Cloud files that cannot be read.
    pub fn sweeps(&mut self, n_bad: u64, n_sweeps: u64) {
        self.damaged("bad_sweeps", share(n_bad, n_sweeps), "of the sweep files cannot be read");
    }

    /// Sweeps of the first LiDAR during which another LiDAR has no returns.
    pub fn missing_sweeps(&mut self, n_missing: u64, n_sweeps: u64) {
        let share = share(n_missing, n_sweeps);
        self.damaged("missing_sweeps", share, "of the sweeps of the first LiDAR have no returns of this LiDAR");
    }

    /// Exposures before the first or after the last sweep.
    pub fn outside(&mut self, n_outside: u64, n_frames: u64) {
        let (share, limit) = (share(n_outside, n_frames), self.limits.max_outside_share);
        if share > limit {
            let text = format!(
                "{} of the {n_frames} exposures lie before the first or after the last sweep, more than max_outside_share = \
                 {limit}; check the clocks of cameras and LiDAR",
                percent(share)
            );
            self.add("exposures_outside", share, text);
        }
    }

    /// Live: packets of which none gave a sweep.
    pub fn no_sweep(&mut self, n_packets: u64) {
        let text = format!("{n_packets} packets were received and recorded, none of them gave a sweep");
        self.add("no_sweep", n_packets as f64, text);
    }

    /// Live: exposures that came more than `max_late_s` after the sweep of their time.
    pub fn late(&mut self, n_late: u64, n_frames: u64, max_late_s: f64) {
        let (share, limit) = (share(n_late, n_frames), self.limits.max_outside_share);
        if share > limit {
            let text = format!(
                "{} of the {n_frames} exposures came more than max_late_s = {max_late_s} after the sweep of their time and colored \
                 nothing, more than max_outside_share = {limit}; they are recorded; check the grabber and its clock",
                percent(share)
            );
            self.add("late_exposures", share, text);
        }
    }

    /// Live: the clock of a sensor is behind that of the LiDAR by this time, up to `delay_s` of which may be the way of its data.
    pub fn clock_offset(&mut self, sensor: &str, behind_s: f64, limit_s: f64, delay_s: f64) {
        let delay = if delay_s > 0.0 { format!(" and more than max_late_s = {delay_s}") } else { String::new() };
        let text = if behind_s < 0.0 {
            format!(
                "stamps of {sensor} are {:.1} ms ahead of those of the LiDAR, more than max_clock_offset_ms = {}",
                -behind_s * 1e3,
                limit_s * 1e3
            )
        } else {
            format!(
                "stamps of {sensor} are {:.1} ms behind those of the LiDAR, more than max_clock_offset_ms = {}{delay}",
                behind_s * 1e3,
                limit_s * 1e3
            )
        };
        let text = format!("{text}; synchronize the clocks by PTP or by GNSS with PPS");
        self.add("clock_offset", behind_s.abs(), text);
    }

    /// Sensors of the manifest that gave nothing.
    pub fn silent(&mut self, sensors: &[String]) {
        if sensors.is_empty() {
            return;
        }
        let text = format!("drive.toml names sensors without any data within the sweeps: {}", sensors.join(", "));
        self.add("silent_sensors", sensors.len() as f64, text);
    }

    fn damaged(&mut self, name: &'static str, share: f64, what: &str) {
        let limit = self.limits.max_damaged_share;
        if share > limit {
            let text = format!("{} {what}, more than max_damaged_share = {limit}", percent(share));
            self.add(name, share, text);
        }
    }
}

/// 0 of nothing.
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}
