//! Robosense packets: RS-LiDAR-16 and RS-LiDAR-32. Not tested on real packets.
//!
//! A data packet is 1248 bytes, big-endian (manuals of RS-LiDAR-16 and RS-LiDAR-32, "MSOP"):
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 8 | `55 aa 05 0a 5a a5 50 a0` |
//! | 20 | 10 | year since 2000, month, day, hour, minute, second, ms (u16), µs (u16) |
//! | 30 | 1 | model: 1 RS-LiDAR-16, 2 RS-LiDAR-32 |
//! | 42 + 100 b | 100 | block b of 12: `ff ee`, encoder angle in 0.01 deg, 32 returns: range in 5 mm, intensity |
//!
//! Two echoes: a block of an RS-LiDAR-16 has both echoes of 16 lasers; of an RS-LiDAR-32, blocks come in pairs of equal angle.
//!
//! **Frame.** As in [`crate`].

mod decode;
mod device;
mod maker;
mod model;

pub use decode::Decoder;
pub use model::Model;

pub(crate) use device::angles;
pub(crate) use model::{is_device, packet_nanos};

/// UDP port of data packets.
pub const DATA_PORT: u16 = 6699;
/// UDP port of packets with the state of the device.
pub const DEVICE_PORT: u16 = 7788;
