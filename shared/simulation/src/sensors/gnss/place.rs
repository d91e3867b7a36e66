//! Geodetic origin of the simulated towns.

use geometry::{Geodetic, LocalFrame};

/// The origin of the world frame: the Pantheon in Paris.
pub const ORIGIN: Geodetic = Geodetic { latitude_deg: 48.846_222, longitude_deg: 2.346_414, altitude_m: 104.6 };
/// Height of the geoid above the ellipsoid at the origin, m; NMEA heights refer to the geoid.
pub const GEOID_M: f64 = 44.6;

/// The world frame around [`ORIGIN`].
pub fn world() -> LocalFrame {
    LocalFrame::new(ORIGIN)
}
