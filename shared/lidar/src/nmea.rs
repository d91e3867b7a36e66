//! Position fixes as NMEA 0183 sentences: GGA (position, height, quality) and RMC (date, speed, course).
//!
//! In a log, lines that are not sentences or have a wrong checksum are counted and skipped. NMEA heights are above the geoid;
//! [`Fix::altitude_m`] is above the WGS84 ellipsoid (height + geoid separation).
//!
//! Not based on the crate `nmea` 0.8, which stores heights, speeds and courses as f32, rounds times through f64 and
//! refuses leap seconds.

mod encode;
mod log;
mod sentence;

pub use encode::{gga_from_fix, gga_without_fix, restamped, rmc_from_fix, rmc_without_fix};
pub use log::{Fix, FixJoiner, LogStats, fixes};
pub use sentence::{Gga, NmeaError, Rmc, Sentence, parse};

/// A knot in m/s.
const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// XOR of the bytes between `$` and `*`.
fn checksum(body: &str) -> u8 {
    body.bytes().fold(0, |sum, byte| sum ^ byte)
}
