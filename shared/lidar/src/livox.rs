//! Livox packets: Mid-360 and Avia. Not tested on real packets.
//!
//! Data packets have a header and points, little-endian (Livox SDK2 and SDK communication protocols):
//!
//! | | Mid-360 | Avia |
//! |---|---|---|
//! | header | 36 bytes: 1: length (u16); 3: time from first to last point, 0.1 µs (u16); 5: number of points (u16); 10: type of the points; 11: type of the time; 28: time, ns (u64) | 18 bytes: 0: version, 5; 8: type of the time; 9: type of the points; 10: time, ns (u64) |
//! | x y z | type 1: mm (i32), reflectivity, tag; type 2: cm (i16), reflectivity, tag | types 2, 4 and 7: mm (i32), reflectivity, tag, for each of 1, 2 and 3 echoes |
//! | spherical | type 3: range in mm (u32), zenith angle and azimuth in 0.01 deg (u16), reflectivity, tag | type 3: as Mid-360 |
//!
//! The pattern does not repeat, and beams have no elevation of their own: points have no rings. Sweeps are pieces of a tenth of a second
//! by the clock of the sensor.
//!
//! **Frame.** As in [`crate`].

mod decode;
mod maker;
mod model;

pub use decode::Decoder;
pub use model::Model;

/// Length of a sweep, ns.
pub(crate) const SWEEP_NANOS: i64 = 100_000_000;
