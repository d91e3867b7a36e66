//! What was wrong with a stream of packets.

use serde::{Deserialize, Serialize};

/// Counts since the start of the stream. Nothing of this is fatal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LidarStats {
    /// Data packets that were decoded.
    pub data_packets: u64,
    /// Position packets.
    pub position_packets: u64,
    /// Data packets that are missing, by the gaps in the sensor's clock.
    pub lost_packets: u64,
    /// Data packets that came twice; the second is left out.
    pub duplicated_packets: u64,
    /// Data packets that came after their successor, left out.
    pub late_packets: u64,
    /// Packets on the sensor's ports that are too short, or cut by the capture, left out.
    pub short_packets: u64,
    /// Packets of others: other ports, other protocols, other sensors; left out.
    pub foreign_packets: u64,
    /// Blocks inside data packets whose flag or angle cannot be, left out.
    pub bad_blocks: u64,
    /// Jumps of the sensor's clock: backwards, or forwards by more than the capture's clock went.
    pub clock_jumps: u64,
    /// Revolutions that were closed because of a gap, a stop of the motor or too many returns.
    pub forced_ends: u64,
    /// Captures that end within a packet.
    pub cut_captures: u64,
    /// Captures that are damaged further in; what follows the damage is not read.
    pub damaged_captures: u64,
}

impl LidarStats {
    /// Whether data of the sensor is missing from the result.
    pub fn has_lost_data(&self) -> bool {
        self.lost_packets + self.late_packets + self.short_packets + self.bad_blocks + self.damaged_captures > 0
    }

    /// All counts by name.
    pub fn counts(&self) -> [(&'static str, u64); 12] {
        [
            ("data_packets", self.data_packets),
            ("position_packets", self.position_packets),
            ("lost_packets", self.lost_packets),
            ("duplicated_packets", self.duplicated_packets),
            ("late_packets", self.late_packets),
            ("short_packets", self.short_packets),
            ("foreign_packets", self.foreign_packets),
            ("bad_blocks", self.bad_blocks),
            ("clock_jumps", self.clock_jumps),
            ("forced_ends", self.forced_ends),
            ("cut_captures", self.cut_captures),
            ("damaged_captures", self.damaged_captures),
        ]
    }
}
