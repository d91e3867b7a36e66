//! Positions of GeoJSON (RFC 7946).

use geometry::Geodetic;
use serde_json::{Value, json};

/// Longitude, latitude, height above the ellipsoid. The eighth decimal of a degree is about 1 mm.
pub(crate) fn position(place: &Geodetic) -> Value {
    json!([rounded(place.longitude_deg, 1e8), rounded(place.latitude_deg, 1e8), rounded(place.altitude_m, 1e2)])
}

/// A value rounded to a multiple of `1 / unit`.
pub(crate) fn rounded(value: f64, unit: f64) -> f64 {
    (value * unit).round() / unit
}
