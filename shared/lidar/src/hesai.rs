//! Hesai packets: Pandar40P, PandarXT-32 and PandarQT64.
//!
//! A data packet has a header (not the Pandar40P), blocks and a tail, little-endian (manuals 40P-en-2001, X32-en-210810 and
//! Q03-en-220110):
//!
//! | part | content |
//! |---|---|
//! | header, 12 bytes | `ee ff`, major and minor version, 2 reserved, beams, blocks, echoes, unit of ranges in mm, number of echoes, flags |
//! | block b | flag `ff ee` (Pandar40P only), encoder angle in 0.01 deg, then the returns of all beams: range, intensity, a reserved byte (not the Pandar40P) |
//! | tail | return mode, time of the packet: µs of the second, and date and time of the day |
//!
//! With two echoes, a shot has two blocks of equal angle. A packet may end with a sequence number, four bytes.
//!
//! A packet of the receiver at the sensor has 512 bytes: flag `ff ee`, date and time, sentence, and at offset 507 whether
//! the clock follows the pulse per second (1) or not (0).
//!
//! **Frame.** As in [`crate`]. Hesai's own frame has x to the right and y forward.

mod decode;
mod maker;
mod model;
mod packet;
mod tables;

pub use decode::Decoder;
pub use model::Model;

pub(crate) use packet::{is_gps, is_pulse_locked};
