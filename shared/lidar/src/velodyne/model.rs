//! Properties of the sensor models.

use super::packet::DataPacket;
use super::tables;
use crate::rings;

/// A supported sensor model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// HDL-32E: 32 lasers, +10.67 to -30.67 deg.
    Hdl32e,
    /// VLP-16: 16 lasers, +15 to -15 deg.
    Vlp16,
    /// VLP-32C: 32 lasers, +15 to -25 deg, closest at the horizon.
    Vlp32c,
    /// HDL-64E: 64 lasers, +2 to -24.9 deg, each with its own corrections.
    Hdl64e,
}

/// Mounting of one laser. Corrections that a model does not have are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laser {
    /// Angle above the horizon, deg.
    pub elevation_deg: f64,
    /// Direction of the beam left of the encoder angle, deg.
    pub azimuth_deg: f64,
    /// Offset added to the measured range, m.
    pub range_m: f64,
    /// Height of the laser above the origin, m: perpendicular to the beam (HDL-64E) or vertical (VLP-16).
    pub up_m: f64,
    /// Distance of the laser to the left of the axis, m.
    pub left_m: f64,
}

/// Firing times of the lasers after the stamp of the packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Timing {
    /// Time from one block to the next, ns.
    pub(super) block_nanos: u32,
    /// Time from one laser to the next, or from one group of lasers that fire at once to the next, ns.
    pub(super) laser_nanos: u32,
    /// Lasers that fire at once.
    pub(super) lasers_at_once: usize,
    /// Lasers per firing sequence. A block has 32 returns, so two sequences if this is 16.
    pub(super) round_lasers: usize,
    /// Time from one firing sequence of a block to the next, ns.
    pub(super) round_nanos: u32,
    /// Whether the encoder angle of a block holds at its first firing and must be interpolated for the others.
    pub(super) interpolate_azimuth: bool,
}

impl Model {
    /// All models.
    pub const ALL: [Model; 4] = [Model::Hdl32e, Model::Vlp16, Model::Vlp32c, Model::Hdl64e];

    /// Name in `drive.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Model::Hdl32e => "hdl32e",
            Model::Vlp16 => "vlp16",
            Model::Vlp32c => "vlp32c",
            Model::Hdl64e => "hdl64e",
        }
    }
    /// Name of the manufacturer.
    pub const fn title(self) -> &'static str {
        match self {
            Model::Hdl32e => "HDL-32E",
            Model::Vlp16 => "VLP-16",
            Model::Vlp32c => "VLP-32C",
            Model::Hdl64e => "HDL-64E",
        }
    }
    /// The model with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }
    /// Model that sent a packet. An HDL-64E is recognized by its lower blocks, the others by their product byte.
    pub fn from_packet(packet: DataPacket<'_>) -> Option<Self> {
        match packet.product() {
            _ if packet.has_lower_blocks() => Some(Model::Hdl64e),
            0x21 => Some(Model::Hdl32e),
            // The Puck Hi-Res (0x24) has the same electronics but other angles.
            0x22 => Some(Model::Vlp16),
            0x28 => Some(Model::Vlp32c),
            _ => None,
        }
    }
    /// Whether this model may have sent a packet. Early firmware leaves the product byte 0; an HDL-64E sends a status there.
    pub fn may_have_sent(self, packet: DataPacket<'_>) -> bool {
        match Self::from_packet(packet) {
            Some(sender) => sender == self || self == Model::Hdl64e,
            None => packet.product() == 0 || self == Model::Hdl64e,
        }
    }
    /// Byte 1205 of its packets; 0 for the HDL-64E, which sends a status there.
    pub const fn product_byte(self) -> u8 {
        match self {
            Model::Hdl32e => 0x21,
            Model::Vlp16 => 0x22,
            Model::Vlp32c => 0x28,
            Model::Hdl64e => 0,
        }
    }
    /// Lasers in firing order; for the HDL-64E, the lasers of the upper block first.
    pub fn lasers(self) -> &'static [Laser] {
        match self {
            Model::Hdl32e => &tables::HDL32E,
            Model::Vlp16 => &tables::VLP16,
            Model::Vlp32c => &tables::VLP32C,
            Model::Hdl64e => &tables::HDL64E,
        }
    }
    /// Resolution of ranges, m.
    pub const fn range_unit_m(self) -> f32 {
        match self {
            Model::Vlp32c => 0.004,
            Model::Hdl32e | Model::Vlp16 | Model::Hdl64e => 0.002,
        }
    }
    /// Number of lasers.
    pub fn n_rings(self) -> usize {
        self.lasers().len()
    }
    /// Ring of each laser: its rank by elevation, 0 = lowest.
    pub fn rings(self) -> Vec<u8> {
        rings(self.lasers().iter().map(|laser| laser.elevation_deg))
    }
    /// Time of a firing after the stamp of the packet, ns. Blocks are 0 to 11, pairs of a dual-return packet count once. Returns are 0
    /// to 31 of a block.
    pub fn firing_nanos(self, block: usize, return_idx: usize) -> u32 {
        let timing = self.timing();
        let round = return_idx / timing.round_lasers;
        let laser = return_idx % timing.round_lasers;
        block as u32 * timing.block_nanos
            + round as u32 * timing.round_nanos
            + (laser / timing.lasers_at_once) as u32 * timing.laser_nanos
    }
    /// Whether the encoder angle of a block holds at its first firing, so that later firings need interpolation. The
    /// corrections of the HDL-64E refer to the angle of the block.
    pub const fn carries_azimuth(self) -> bool {
        self.timing().interpolate_azimuth
    }
    /// Time from one packet to the next, ns.
    pub fn packet_nanos(self) -> u32 {
        self.timing().block_nanos * super::BLOCKS_PER_PACKET as u32
    }

    pub(super) const fn timing(self) -> Timing {
        match self {
            Model::Hdl32e => Timing {
                block_nanos: 46_080,
                laser_nanos: 1_152,
                lasers_at_once: 1,
                round_lasers: 32,
                round_nanos: 46_080,
                interpolate_azimuth: true,
            },
            Model::Vlp16 => Timing {
                block_nanos: 110_592,
                laser_nanos: 2_304,
                lasers_at_once: 1,
                round_lasers: 16,
                round_nanos: 55_296,
                interpolate_azimuth: true,
            },
            Model::Vlp32c => Timing {
                block_nanos: 55_296,
                laser_nanos: 2_304,
                lasers_at_once: 2,
                round_lasers: 32,
                round_nanos: 55_296,
                interpolate_azimuth: true,
            },
            // Generations differ: the S3 sends a pair every 57.6 µs, the S1 a block every 32 µs. Corrections refer to the angle
            // of the block.
            Model::Hdl64e => Timing {
                block_nanos: 28_800,
                laser_nanos: 900,
                lasers_at_once: 1,
                round_lasers: 32,
                round_nanos: 28_800,
                interpolate_azimuth: false,
            },
        }
    }
}
