//! Limits of the types of this crate.

/// Largest pattern: the 25 bands of 5 x 5 fit the 32-bit mask of a cell.
pub const MAX_PATTERN: u32 = 5;

/// Largest number of frames whose u16 samples can be summed in a u32 without overflow.
pub(crate) const MAX_FRAMES: u32 = 65_536;
