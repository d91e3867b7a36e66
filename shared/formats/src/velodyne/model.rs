//! The sensors as data.

use super::packet::DataPacket;
use super::tables;

/// A sensor that this module knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// HDL-32E: 32 lasers, +10.67 to -30.67 deg.
    Hdl32e,
    /// VLP-16: 16 lasers, +15 to -15 deg.
    Vlp16,
    /// HDL-64E: 64 lasers, +2 to -24.9 deg, each with its own corrections.
    Hdl64e,
}

/// How one laser is mounted. What is zero for a model does not count there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laser {
    /// Angle above the horizon, deg.
    pub elevation_deg: f64,
    /// The beam looks this far left of the encoder's angle, deg.
    pub azimuth_deg: f64,
    /// Added to the measured range, m.
    pub range_m: f64,
    /// The beam starts this far above the origin, m, at right angles to the beam (HDL-64E) or vertically (VLP-16).
    pub up_m: f64,
    /// The beam starts this far left of the axis, m.
    pub left_m: f64,
}

/// When lasers fire after the packet's stamp, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Timing {
    /// From one block to the next.
    pub(super) block_nanos: u32,
    /// From one laser to the next.
    pub(super) laser_nanos: u32,
    /// Lasers of a round; a block has 32 returns, so more than one round if this is 16.
    pub(super) round_lasers: usize,
    /// From one round of a block to the next.
    pub(super) round_nanos: u32,
    /// Whether the encoder's angle is that of the block's first firing alone and must be carried on for the others.
    pub(super) interpolate_azimuth: bool,
}

impl Model {
    /// All of them.
    pub const ALL: [Model; 3] = [Model::Hdl32e, Model::Vlp16, Model::Hdl64e];

    /// As drive.toml writes it.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Hdl32e => "hdl32e",
            Model::Vlp16 => "vlp16",
            Model::Hdl64e => "hdl64e",
        }
    }
    /// The model of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }
    /// Who sent the packet: an HDL-64E shows by its lower blocks, the others by their product byte.
    pub fn of_packet(packet: DataPacket<'_>) -> Option<Self> {
        match packet.product() {
            _ if packet.has_lower_blocks() => Some(Model::Hdl64e),
            0x21 => Some(Model::Hdl32e),
            // The Puck LITE (24: Hi-Res) has the same electronics but other angles.
            0x22 => Some(Model::Vlp16),
            _ => None,
        }
    }
    /// Whether a packet may be this model's: early firmware leaves the product byte 0, an HDL-64E has a status there.
    pub fn may_have_sent(self, packet: DataPacket<'_>) -> bool {
        match Self::of_packet(packet) {
            Some(sender) => sender == self || self == Model::Hdl64e,
            None => packet.product() == 0 || self == Model::Hdl64e,
        }
    }
    /// Byte 1205 of its packets; 0 for the HDL-64E, which has a status there.
    pub const fn product_byte(self) -> u8 {
        match self {
            Model::Hdl32e => 0x21,
            Model::Vlp16 => 0x22,
            Model::Hdl64e => 0,
        }
    }
    /// Lasers in firing order; of the HDL-64E the upper block's first.
    pub fn lasers(self) -> &'static [Laser] {
        match self {
            Model::Hdl32e => &tables::HDL32E,
            Model::Vlp16 => &tables::VLP16,
            Model::Hdl64e => &tables::HDL64E,
        }
    }
    /// How many lasers it has.
    pub fn n_rings(self) -> usize {
        self.lasers().len()
    }
    /// Ring of each laser: its rank by elevation, 0 = lowest.
    pub fn rings(self) -> Vec<u8> {
        let lasers = self.lasers();
        let below = |laser: &Laser| lasers.iter().filter(|other| other.elevation_deg < laser.elevation_deg).count();
        lasers.iter().map(|laser| below(laser) as u8).collect()
    }
    /// Time of a firing after the packet's stamp, ns: block 0 to 11 (pairs of a dual-return packet count once), return 0 to
    /// 31 of the block.
    pub fn firing_nanos(self, block: usize, return_idx: usize) -> u32 {
        let timing = self.timing();
        let (round, laser) = (return_idx / timing.round_lasers, return_idx % timing.round_lasers);
        block as u32 * timing.block_nanos + round as u32 * timing.round_nanos + laser as u32 * timing.laser_nanos
    }
    /// Whether the encoder's angle is that of a block's first firing alone, and the head has turned on at the others. The
    /// HDL-64E's corrections hold for the block's angle.
    pub const fn carries_azimuth(self) -> bool {
        self.timing().interpolate_azimuth
    }
    /// From one packet to the next, ns; of an HDL-64E whose blocks come in pairs or follow each other.
    pub fn packet_nanos(self) -> u32 {
        self.timing().block_nanos * super::BLOCKS_PER_PACKET as u32
    }

    pub(super) const fn timing(self) -> Timing {
        match self {
            Model::Hdl32e => Timing {
                block_nanos: 46_080,
                laser_nanos: 1_152,
                round_lasers: 32,
                round_nanos: 46_080,
                interpolate_azimuth: true,
            },
            Model::Vlp16 => Timing {
                block_nanos: 110_592,
                laser_nanos: 2_304,
                round_lasers: 16,
                round_nanos: 55_296,
                interpolate_azimuth: true,
            },
            // Generations differ: 57.6 µs from pair to pair of the S3; the S1 sends a block every 32 µs. Its corrections hold
            // for the block's angle.
            Model::Hdl64e => Timing {
                block_nanos: 28_800,
                laser_nanos: 900,
                round_lasers: 32,
                round_nanos: 28_800,
                interpolate_azimuth: false,
            },
        }
    }
}
