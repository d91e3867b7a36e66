//! Universal Transverse Mercator coordinates.

use crate::{Geodetic, Projection, ProjectionError};

/// A UTM zone on WGS84 with its projection.
#[derive(Debug)]
pub struct Utm {
    zone: u32,
    is_north: bool,
    projection: Projection,
}

/// A position without UTM coordinates.
#[derive(Debug, thiserror::Error)]
pub enum UtmError {
    /// UTM does not cover the poles.
    #[error("latitude {0} degrees is outside UTM; expected -80 to 84")]
    Latitude(f64),
    /// The projection library failed.
    #[error("UTM zone {zone}: {cause}")]
    Projection {
        /// Number of the zone, 1 to 60.
        zone: u32,
        /// Error of the projection library.
        cause: ProjectionError,
    },
}

impl Utm {
    /// The zone of a position between latitudes -80 and 84 degrees. A zone covers 6 degrees of longitude, except in Norway and
    /// Svalbard (DMA TM 8358.2, chapter 1).
    pub fn from_geodetic(place: &Geodetic) -> Result<Self, UtmError> {
        let lat = place.latitude_deg;
        let lon = place.longitude_deg;
        if !(-80.0..=84.0).contains(&lat) {
            return Err(UtmError::Latitude(lat));
        }
        let regular = ((lon + 180.0) / 6.0).floor().clamp(0.0, 59.0) as u32 + 1;
        let zone = match lon {
            lon if (56.0..64.0).contains(&lat) && (3.0..12.0).contains(&lon) => 32,
            lon if lat >= 72.0 && (0.0..42.0).contains(&lon) => 31 + 2 * ((lon + 3.0) / 12.0).floor() as u32,
            _ => regular,
        };
        let is_north = lat >= 0.0;
        let south = if is_north { "" } else { " +south" };
        let projection = Projection::new(&format!("+proj=utm +zone={zone}{south}"), "+datum=WGS84")
            .map_err(|cause| UtmError::Projection { zone, cause })?;
        Ok(Self { zone, is_north, projection })
    }
    /// Number of the zone, 1 to 60.
    pub const fn zone(&self) -> u32 {
        self.zone
    }
    /// Hemisphere: `N` or `S`.
    pub const fn hemisphere(&self) -> char {
        if self.is_north { 'N' } else { 'S' }
    }
    /// EPSG code: 32601 to 32660 in the north, 32701 to 32760 in the south.
    pub const fn epsg(&self) -> u32 {
        (if self.is_north { 32_600 } else { 32_700 }) + self.zone
    }
    /// Easting, northing (m, within 0.1 mm) and height above the ellipsoid (m) of a position in or near the zone.
    pub fn project(&self, place: &Geodetic) -> Result<[f64; 3], UtmError> {
        self.projection.project(place).map_err(|cause| UtmError::Projection { zone: self.zone, cause })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference coordinates from pyproj 3.7.2 (PROJ 9.5.1), `Transformer.from_crs(4979, EPSG)`; zones from the map of
    /// the reference.
    #[test]
    fn coordinates_and_zones_equal_proj() {
        for (lat, lon, epsg, expected) in [
            (48.846_222, 2.346_414, 32_631, [452_048.210_3, 5_410_567.173_6]),
            (-33.856_8, 151.215_3, 32_756, [334_900.569_7, 6_252_288.752_9]),
            (60.39, 5.32, 32_632, [297_230.220_2, 6_700_510.175_3]),
            (78.22, 15.65, 32_633, [514_813.527_3, 8_683_004.153_3]),
            (0.0, -179.9, 32_601, [177_163.806_0, 0.0]),
            (-0.01, 179.99, 32_760, [832_864.270_0, 9_998_893.182_6]),
            (83.9, 33.5, 32_637, [434_846.693_5, 9_320_042.026_1]),
        ] {
            let place = Geodetic::new(lat, lon, 12.5).expect("a position");
            let utm = Utm::from_geodetic(&place).expect("a zone");
            assert_eq!(utm.epsg(), epsg, "{lat} {lon}");
            let [east, north, height] = utm.project(&place).expect("coordinates");
            assert!((east - expected[0]).hypot(north - expected[1]) < 1e-3, "{lat} {lon}: {east} {north}");
            assert_eq!(height, 12.5);
        }
    }

    #[test]
    fn poles_have_no_zone() {
        for lat in [84.5, -80.5] {
            assert!(matches!(
                Utm::from_geodetic(&Geodetic::new(lat, 0.0, 0.0).expect("a position")),
                Err(UtmError::Latitude(_))
            ));
        }
    }
}
