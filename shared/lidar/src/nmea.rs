//! Position fixes as NMEA 0183 sentences: GGA (position, height, quality), RMC (date, speed, course), ZDA (date), GST (standard
//! deviations) and GSA (vertical dilution). UBX-NAV-PVT messages between the sentences of a log add standard deviations.
//!
//! In a log, lines that are not sentences or have a wrong checksum are counted and skipped; the first one is reported with its reason.
//! Binary messages between sentences, tag blocks and times in front of them are skipped. NMEA heights are above the geoid;
//! [`Fix::altitude_m`] is above the WGS84 ellipsoid (height + geoid separation).
//!
//! Not based on the crate `nmea` 0.8, which stores heights, speeds and courses as f32, rounds times through f64 and
//! refuses leap seconds.

mod alternation;
mod encode;
mod fields;
mod joiner;
mod line;
mod log;
mod sentence;
mod ubx;

pub use encode::{gga_from_fix, gga_without_fix, gst_from_fix, restamped, rmc_from_fix, rmc_without_fix};
pub use joiner::FixJoiner;
pub use line::{parse, sentence};
pub use log::{Fix, LogStats, fixes, fixes_above_geoid};
pub use sentence::{Gga, Gsa, Gst, NmeaError, Rmc, Sentence, StatedDeviation, Zda};

/// A knot in m/s.
const KNOT_MPS: f64 = 1852.0 / 3600.0;

/// Largest height of the geoid above or below the ellipsoid, with a margin, m.
pub const MAX_GEOID_M: f64 = 200.0;

/// Whether a position is 0 0, which receivers without a position report. The place is in the sea, within a metre.
pub fn is_null_island(position_deg: [f64; 2]) -> bool {
    position_deg.iter().all(|angle| angle.abs() < 1e-5)
}

/// XOR of the bytes between `$` and `*`.
fn checksum(body: &str) -> u8 {
    body.bytes().fold(0, |sum, byte| sum ^ byte)
}
