//! How far the data of a drive can be trusted: shares of what is damaged, foreign or missing, against the limits of the settings.

use crate::Settings;
use formats::nmea::LogStats;
use formats::velodyne::LidarStats;
use serde::{Deserialize, Serialize};
use stage::Outputs;

/// Blocks of a data packet.
const BLOCKS: f64 = formats::velodyne::BLOCKS_PER_PACKET as f64;

/// What was published and what was not, since the begin of the drive.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Tally {
    pub(crate) images: Frames,
    pub(crate) mosaics: Frames,
    pub(crate) imu_samples: u64,
    pub(crate) bad_imu_lines: u64,
    /// Fixes with a height, and all.
    pub(crate) gnss_rows: u64,
    pub(crate) fixes: u64,
}

/// Exposures of one kind of camera.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Frames {
    pub(crate) published: u64,
    pub(crate) bad: u64,
}

impl Frames {
    pub(crate) fn add(&mut self, is_bad: bool) {
        *(if is_bad { &mut self.bad } else { &mut self.published }) += 1;
    }
}

/// Reports doubts to the outputs, by the limits of the settings.
pub(crate) struct Doubts<'a> {
    pub(crate) settings: &'a Settings,
    pub(crate) outputs: &'a mut Outputs,
}

impl Doubts<'_> {
    /// Packets and captures. `n_bytes`: size of all captures.
    pub(crate) fn captures(&mut self, stats: &LidarStats, n_bytes: u64) {
        let others = stats.foreign_packets + stats.short_packets;
        let n_packets = others + stats.data_packets + stats.position_packets;
        let (share, limit) = (share(others, n_packets), self.settings.max_foreign_share);
        if share > limit {
            let text = format!(
                "{} of the {n_packets} packets are foreign or too short, more than max_foreign_share = {limit}; check that \
                 the sweeps are those of the right sensor",
                percent(share)
            );
            self.outputs.doubt("foreign_packets", share, text);
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
            self.outputs.doubt("cut_captures", stats.cut_captures as f64, text);
        }
    }

    /// Sentences of a GNSS receiver. `n_used` of `n_fixes` have a height.
    pub(crate) fn log(&mut self, log: &LogStats, n_used: u64, n_fixes: u64) {
        let n_lines = log.sentences + log.other_sentences + log.bad_lines;
        self.damaged("bad_nmea_lines", share(log.bad_lines, n_lines), "of the NMEA lines are damaged");
        let n_epochs = n_fixes + log.without_fix + log.out_of_order;
        let (share, limit) = (share(n_used, n_epochs), self.settings.min_fix_share);
        if log.sentences > 0 && share < limit {
            let text = format!(
                "only {} of the {n_epochs} GNSS epochs have position and height, less than min_fix_share = {limit}; the \
                 receiver must log GGA and RMC sentences",
                percent(share)
            );
            self.outputs.doubt("few_fixes", share, text);
        }
    }

    /// Files and lines that cannot be used.
    pub(crate) fn files(&mut self, tally: &Tally, n_sweeps: u64, n_bad_sweeps: u64) {
        let share_of = |frames: &Frames| share(frames.bad, frames.bad + frames.published);
        self.damaged("bad_images", share_of(&tally.images), "of the images are damaged or have the wrong size");
        self.damaged("bad_mosaics", share_of(&tally.mosaics), "of the mosaics are damaged or have the wrong size");
        let n_lines = tally.bad_imu_lines + tally.imu_samples;
        self.damaged(
            "bad_imu_lines",
            share(tally.bad_imu_lines, n_lines),
            "of the IMU lines are damaged or impossible",
        );
        self.damaged("bad_sweeps", share(n_bad_sweeps, n_sweeps), "of the sweep files cannot be read");
    }

    /// Exposures before the first or after the last sweep.
    pub(crate) fn outside(&mut self, n_outside: u64, n_frames: u64) {
        let (share, limit) = (share(n_outside, n_frames), self.settings.max_outside_share);
        if share > limit {
            let text = format!(
                "{} of the {n_frames} exposures lie before the first or after the last sweep, more than max_outside_share = \
                 {limit}; check the clocks of cameras and LiDAR",
                percent(share)
            );
            self.outputs.doubt("exposures_outside", share, text);
        }
    }

    /// Sensors of the manifest that gave nothing.
    pub(crate) fn silent(&mut self, sensors: &[String]) {
        if sensors.is_empty() {
            return;
        }
        let text = format!("drive.toml names sensors without any data within the sweeps: {}", sensors.join(", "));
        self.outputs.doubt("silent_sensors", sensors.len() as f64, text);
    }

    fn damaged(&mut self, name: &'static str, share: f64, what: &str) {
        let limit = self.settings.max_damaged_share;
        if share > limit {
            let text = format!("{} {what}, more than max_damaged_share = {limit}", percent(share));
            self.outputs.doubt(name, share, text);
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
