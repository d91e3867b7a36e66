//! Velodyne packets: decoding, encoding, and calibration files.
//!
//! A data packet is 1206 bytes, little-endian (HDL-32E manual 63-9113, VLP-16 manual 63-9243, HDL-64E manual 63-HDL64ES3):
//!
//! | offset | size | content |
//! |---|---|---|
//! | 100 b | 2 | block b of 12: flag `ff ee` (HDL-64E: `ff ee` upper, `ff dd` lower lasers) |
//! | 100 b + 2 | 2 | encoder angle, 0.01 deg, 0 to 35999, clockwise seen from above |
//! | 100 b + 4 + 3 l | 3 | return l of 32: range in 2 mm (VLP-32C: 4 mm; 0 = none), intensity |
//! | 1200 | 4 | µs past the hour at the first firing |
//! | 1204 | 1 | return mode: `37` strongest, `38` last, `39` both |
//! | 1205 | 1 | product: `21` HDL-32E, `22` VLP-16, `28` VLP-32C |
//!
//! A position packet is 512 bytes: µs past the hour at 198, state of the pulse per second at 202 (0 none, 1 synchronizing, 2 locked,
//! 3 error), an NMEA sentence `$GPRMC` from 206 on.
//!
//! **Frame.** Encoder angles are measured from the front of the sensor: a beam at angle 0 looks along +x, a beam at 90 deg to the
//! right, along -y. With elevation e and azimuth a, x = r cos e cos a, y = -r cos e sin a, z = r sin e. (Manuals and viewer of the
//! manufacturer call the same axes y, -x and z.)

mod calibration;
mod decode;
mod encode;
mod maker;
mod model;
mod packet;
mod position;
mod tables;

pub use calibration::{LaserFileError, lasers_from_file};
pub use decode::Decoder;
pub use encode::{PulseStatus, RawBlock, RawReturn, encode_data_packet, encode_position_packet, restamp};
pub use model::{Laser, Model};
pub use packet::{
    BLOCKS_PER_PACKET, DATA_PACKET_BYTES, DATA_PORT, DataPacket, LASERS_PER_BLOCK, MAX_RETURNS_PER_PACKET,
    POSITION_PACKET_BYTES, POSITION_PORT, ReturnMode,
};
pub use position::PositionPacket;
