//! Blocks of a packet and their returns.

use lidar::velodyne::{BLOCKS_PER_PACKET, LASERS_PER_BLOCK, RawBlock, RawReturn};
use messages::ClassId;

/// Blocks of a packet.
pub const N_BLOCKS: usize = BLOCKS_PER_PACKET;
/// Returns of a block.
pub const N_LASERS: usize = LASERS_PER_BLOCK;

/// A block of a packet: one round of firings; two rounds of a VLP-16, half a round of an HDL-64E.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Encoder angle at the first firing of the block, 0.01 deg, 0 to 35999.
    pub azimuth: u16,
    /// Whether the block is from lasers 32 to 63.
    pub is_lower: bool,
    /// Returns in firing order.
    pub returns: [Option<LidarReturn>; N_LASERS],
}

impl Block {
    /// The block in the encoding of the device.
    pub fn raw(&self) -> RawBlock {
        let raw_return = |found: &LidarReturn| RawReturn { range_2mm: found.range_2mm, intensity: found.intensity };
        RawBlock {
            azimuth: self.azimuth,
            is_lower: self.is_lower,
            returns: self.returns.each_ref().map(|found| found.as_ref().map(raw_return).unwrap_or_default()),
        }
    }
}

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarReturn {
    /// Range as sent, in units of 2 mm, never zero.
    pub range_2mm: u16,
    /// Intensity: 0 to 100 for diffuse targets, above for retroreflectors.
    pub intensity: u8,
    /// Ground truth: class of the surface that returned most of the light.
    pub class: ClassId,
    /// Ground truth: instance of this surface.
    pub instance: u16,
    /// Ground truth: range of the echo, m, before noise and correction.
    pub range_m: f32,
}
