//! Limits of what the types of this crate can hold.

/// Largest pattern: the 25 bands of 5 x 5 fit the 32-bit mask of a cell.
pub const MAX_PATTERN: u32 = 5;

/// Frames that a sum of u16 samples in a u32 can hold without overflow.
pub(crate) const MAX_FRAMES: u32 = 65_536;
