//! Ouster packets: OS0, OS1 and OS2, profiles `LEGACY`, `RNG15_RFL8_NIR8`, `RNG19_RFL8_SIG16_NIR16` and
//! `RNG19_RFL8_SIG16_NIR16_DUAL`, with the sensor's metadata file.
//!
//! A data packet has a header of 32 bytes (not `LEGACY`), columns and a footer of 32 bytes (not `LEGACY`), little-endian (Firmware User
//! Manual, "Lidar Data Packet Format"):
//!
//! | part | content |
//! |---|---|
//! | header | 0: type of the packet, 1 = data; 2: frame; 4: number of the initialization; 7: serial number of the sensor, 5 bytes |
//! | column | time, ns (u64); number of the column in the revolution (u16); `LEGACY`: frame (u16), encoder (u32); else: status (u16), bit 0 = valid; pixels of all beams, the highest first; `LEGACY`: status (u32), ffffffff = valid |
//! | pixel, `LEGACY`, 12 bytes | 0: range in mm, 20 bits; 4: reflectivity (u16) |
//! | pixel, low data rate, 4 bytes | 0: range in 8 mm, 15 bits; 2: reflectivity |
//! | pixel, single return, 12 bytes | 0: range in mm, 19 bits; 4: reflectivity |
//! | pixel, dual return, 16 bytes | 0: range in mm, 19 bits; 3: reflectivity; 4: range of the second echo, 19 bits; 7: its reflectivity |
//!
//! **Frame.** The sensor frame of Ouster, the same as in [`crate`]: x away from the connector.

mod decode;
#[cfg(test)]
mod digest_test;
mod maker;
mod metadata;
mod packet;

pub use decode::Decoder;
pub use metadata::{Metadata, MetadataError};
pub use packet::Profile;

pub(crate) use maker::Model;
pub(crate) use packet::{is_common_size, is_imu};

/// UDP port of data packets.
pub const DATA_PORT: u16 = 7502;
/// UDP port of IMU packets.
pub const IMU_PORT: u16 = 7503;
