//! Counters of a packet stream.

use serde::{Deserialize, Serialize};

/// Counters since the start of the stream. None of the counted faults is fatal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LidarStats {
    /// Decoded data packets.
    pub data_packets: u64,
    /// Position packets; for makers other than Velodyne, packets of IMU, receiver and device state, which are not read.
    pub position_packets: u64,
    /// Packets that report that the clock of the sensor follows its reference.
    pub clock_locked: u64,
    /// Packets that report that the clock does not follow a reference: no pulse, still synchronizing, an error, or
    /// free-running.
    pub clock_unlocked: u64,
    /// Lost data packets, by gaps of the sensor clock.
    pub lost_packets: u64,
    /// Duplicated data packets; the second copy is skipped.
    pub duplicated_packets: u64,
    /// Data packets that arrived after a later packet and were put in order.
    pub reordered_packets: u64,
    /// Data packets that arrived too late to be put in order; skipped.
    pub late_packets: u64,
    /// Packets on the ports of the sensor that are too short or truncated by the capture; skipped.
    pub short_packets: u64,
    /// Packets of other ports, protocols or sensors; skipped.
    pub foreign_packets: u64,
    /// Changes of the port from which the sensor sends, after a silence.
    pub source_changes: u64,
    /// Silence before these changes, ms.
    pub source_silent_ms: u64,
    /// Data packets from another port of the sensor's address that sends at the same time; they are among the foreign packets.
    pub second_source_packets: u64,
    /// Blocks of data packets with an invalid flag or angle; skipped.
    pub bad_blocks: u64,
    /// Jumps of the sensor clock: backwards, or forwards by more than the clock of the capture.
    pub clock_jumps: u64,
    /// Jumps at which both clocks, of the sensor and of the capture, show earlier times than before.
    pub clocks_set_back: u64,
    /// Sum of these steps by the clock of the capture, ms.
    pub set_back_ms: u64,
    /// Jumps of the clock of the capture while the clock of the sensor went on.
    pub recorder_jumps: u64,
    /// The largest of these jumps, ms.
    pub recorder_jump_ms: u64,
    /// Revolutions that ended because of a gap, a stopped motor or too many returns.
    pub forced_ends: u64,
    /// Captures that end inside a packet.
    pub cut_captures: u64,
    /// Damaged captures; the data after the damage is not read.
    pub damaged_captures: u64,
    /// Bytes of cut and damaged captures that are not read.
    pub unread_bytes: u64,
}

impl LidarStats {
    /// Whether sensor data is missing in the result.
    pub fn has_lost_data(&self) -> bool {
        self.lost_packets + self.late_packets + self.short_packets + self.bad_blocks + self.damaged_captures > 0
    }

    /// All counters by name.
    pub fn counts(&self) -> [(&'static str, u64); 19] {
        [
            ("data_packets", self.data_packets),
            ("position_packets", self.position_packets),
            ("pps_not_locked", self.clock_unlocked),
            ("lost_packets", self.lost_packets),
            ("duplicated_packets", self.duplicated_packets),
            ("reordered_packets", self.reordered_packets),
            ("late_packets", self.late_packets),
            ("short_packets", self.short_packets),
            ("foreign_packets", self.foreign_packets),
            ("source_changes", self.source_changes),
            ("second_source_packets", self.second_source_packets),
            ("bad_blocks", self.bad_blocks),
            ("clock_jumps", self.clock_jumps),
            ("recorder_jumps", self.recorder_jumps),
            ("clocks_set_back", self.clocks_set_back),
            ("forced_ends", self.forced_ends),
            ("cut_captures", self.cut_captures),
            ("damaged_captures", self.damaged_captures),
            ("unread_bytes", self.unread_bytes),
        ]
    }
}
