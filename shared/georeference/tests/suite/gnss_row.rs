//! Rows of topic `gnss`.

use geometry::{Geodetic, Vector3};
use messages::GnssRow;

/// A fix of a receiver with corrections. `velocity`: towards east, north and up, m/s, exact.
pub fn gnss_row(second: f64, place: &Geodetic, velocity: &Vector3<f64>) -> GnssRow {
    GnssRow {
        stamp: (second * 1e9).round() as i64,
        latitude_deg: place.latitude_deg,
        longitude_deg: place.longitude_deg,
        altitude_m: place.altitude_m,
        speed_mps: velocity.xy().norm(),
        course_deg: velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0),
        hdop: 1.0,
        satellites: 12,
        quality: 2,
        ..GnssRow::default()
    }
}
