//! Layout of data packets, read in place.

use crate::TURN;

/// UDP port of data packets.
pub const DATA_PORT: u16 = 2368;
/// UDP port of position packets.
pub const POSITION_PORT: u16 = 8308;
/// Bytes of the payload of a data packet.
pub const DATA_PACKET_BYTES: usize = 1206;
/// Bytes of the payload of a position packet.
pub const POSITION_PACKET_BYTES: usize = 512;
/// Blocks of a data packet.
pub const BLOCKS_PER_PACKET: usize = 12;
/// Returns of a block.
pub const LASERS_PER_BLOCK: usize = 32;
/// Returns of a data packet.
pub const MAX_RETURNS_PER_PACKET: usize = BLOCKS_PER_PACKET * LASERS_PER_BLOCK;

pub(super) const BLOCK_BYTES: usize = 100;
pub(super) const MICROS_AT: usize = 1200;
pub(super) const FACTORY_AT: usize = 1204;
pub(super) const POSITION_MICROS_AT: usize = 198;
pub(super) const POSITION_PULSE_AT: usize = 202;
pub(super) const POSITION_NMEA_AT: usize = 206;
/// Flag of a block of lasers 0 to 31.
pub(super) const UPPER_BLOCK: u16 = 0xeeff;
/// Flag of a block of lasers 32 to 63.
pub(super) const LOWER_BLOCK: u16 = 0xddff;

/// Echoes of a shot that the sensor sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ReturnMode {
    /// The strongest echo.
    Strongest = 0x37,
    /// The farthest echo.
    Last = 0x38,
    /// Both: blocks come in pairs of equal azimuth, the last echo first, then the strongest, or the second strongest if the last is the
    /// strongest.
    Dual = 0x39,
}

/// Payload of a data packet.
#[derive(Clone, Copy, Debug)]
pub struct DataPacket<'a>(&'a [u8; DATA_PACKET_BYTES]);

/// One block of a data packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a>(&'a [u8; BLOCK_BYTES]);

impl<'a> DataPacket<'a> {
    /// Wraps a payload. `None` unless it has the size of a data packet and begins with a block.
    pub fn new(payload: &'a [u8]) -> Option<Self> {
        let bytes: &[u8; DATA_PACKET_BYTES] = payload.try_into().ok()?;
        let packet = Self(bytes);
        packet.block(0).is_some().then_some(packet)
    }
    /// The bytes of the packet.
    pub fn bytes(self) -> &'a [u8; DATA_PACKET_BYTES] {
        self.0
    }
    /// µs past the hour at the first firing. Early HDL-64E send other data here.
    pub fn micros(self) -> u32 {
        let b = self.0;
        u32::from_le_bytes([b[MICROS_AT], b[MICROS_AT + 1], b[MICROS_AT + 2], b[MICROS_AT + 3]])
    }
    /// Return mode of HDL-32E and VLP-16; `None` for other values.
    pub fn return_mode(self) -> Option<ReturnMode> {
        match self.0[FACTORY_AT] {
            0x37 => Some(ReturnMode::Strongest),
            0x38 => Some(ReturnMode::Last),
            0x39 => Some(ReturnMode::Dual),
            _ => None,
        }
    }
    /// Product byte (the last byte) of HDL-32E and later models.
    pub fn product(self) -> u8 {
        self.0[FACTORY_AT + 1]
    }
    /// Whether it has a block of lasers 32 to 63, which only an HDL-64E sends.
    pub fn has_lower_blocks(self) -> bool {
        (0..BLOCKS_PER_PACKET).any(|index| self.block(index).is_some_and(Block::is_lower))
    }
    /// Encoder angle of a block; `None` for invalid blocks.
    pub fn azimuth(self, index: usize) -> Option<u16> {
        self.block(index).map(Block::azimuth)
    }
    /// A block; `None` unless flag and azimuth are valid.
    pub(super) fn block(self, index: usize) -> Option<Block<'a>> {
        let bytes: &[u8; BLOCK_BYTES] = self.0.get(index * BLOCK_BYTES..)?.first_chunk()?;
        let block = Block(bytes);
        (matches!(block.flag(), UPPER_BLOCK | LOWER_BLOCK) && block.azimuth() < TURN).then_some(block)
    }
}

impl<'a> Block<'a> {
    fn flag(self) -> u16 {
        u16::from_le_bytes([self.0[0], self.0[1]])
    }
    /// Whether the block contains lasers 32 to 63.
    pub(super) fn is_lower(self) -> bool {
        self.flag() == LOWER_BLOCK
    }
    pub(super) fn azimuth(self) -> u16 {
        u16::from_le_bytes([self.0[2], self.0[3]])
    }
    /// Bytes of the returns, three per return.
    pub(super) fn returns(self) -> &'a [u8] {
        &self.0[4..]
    }
}
