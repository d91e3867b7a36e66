//! A local east-north-up frame on the WGS84 ellipsoid.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Half the larger axis of the WGS84 ellipsoid, m (NIMA TR8350.2, table 3.1).
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Its squared first eccentricity, from the flattening 1 / 298.257223563.
const ECCENTRICITY2: f64 = 6.694_379_990_141_33e-3;

/// A place on WGS84.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geodetic {
    /// Degrees, north positive, -90 to 90.
    pub latitude_deg: f64,
    /// Degrees, east positive, -180 to 180.
    pub longitude_deg: f64,
    /// Above the ellipsoid, m.
    pub altitude_m: f64,
}

impl Geodetic {
    /// `None` unless the numbers are finite and within their ranges.
    pub fn new(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Option<Self> {
        let sound = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 && altitude_m.is_finite();
        sound.then_some(Self { latitude_deg, longitude_deg, altitude_m })
    }

    /// In the Earth's own frame: x towards latitude and longitude 0, z towards the north pole, m.
    fn ecef(&self) -> Vector3<f64> {
        let (lat, lon) = (self.latitude_deg.to_radians(), self.longitude_deg.to_radians());
        let radius = across_radius_m(lat);
        Vector3::new(
            (radius + self.altitude_m) * lat.cos() * lon.cos(),
            (radius + self.altitude_m) * lat.cos() * lon.sin(),
            (radius * (1.0 - ECCENTRICITY2) + self.altitude_m) * lat.sin(),
        )
    }

    fn from_ecef(p: &Vector3<f64>) -> Self {
        let across = p.x.hypot(p.y);
        // Fixed point of the latitude; the error shrinks by 0.0067 a round, so six leave less than a nanometre from 10 km
        // below to 1000 km above the ground. The height is taken along the normal, which holds at the poles, too.
        let mut lat = p.z.atan2(across * (1.0 - ECCENTRICITY2));
        for _ in 0..6 {
            lat = (p.z + ECCENTRICITY2 * across_radius_m(lat) * lat.sin()).atan2(across);
        }
        let foot = across_radius_m(lat) * (1.0 - ECCENTRICITY2 * lat.sin().powi(2));
        Self {
            latitude_deg: lat.to_degrees(),
            longitude_deg: p.y.atan2(p.x).to_degrees(),
            altitude_m: across * lat.cos() + p.z * lat.sin() - foot,
        }
    }
}

/// Radius of curvature across the meridian at a latitude in rad, m.
fn across_radius_m(lat: f64) -> f64 {
    SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * lat.sin().powi(2)).sqrt()
}

/// The world frame of a drive on the Earth: east, north and up at an origin (`docs/conventions.md`). Exact, not a map: up is
/// straight, so 1 km from the origin the ellipsoid lies 8 cm below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    origin_in_ecef: Vector3<f64>,
    /// East, north, up.
    axes: [Vector3<f64>; 3],
}

impl LocalFrame {
    /// Around `origin`.
    pub fn new(origin: Geodetic) -> Self {
        let (lat, lon) = (origin.latitude_deg.to_radians(), origin.longitude_deg.to_radians());
        let east = Vector3::new(-lon.sin(), lon.cos(), 0.0);
        let north = Vector3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos());
        Self { origin, origin_in_ecef: origin.ecef(), axes: [east, north, east.cross(&north)] }
    }
    /// Where the frame has its zero.
    pub const fn origin(&self) -> Geodetic {
        self.origin
    }
    /// A place in this frame, m.
    pub fn world_from_geodetic(&self, place: &Geodetic) -> Point3<f64> {
        self.world_from_ecef(&place.ecef())
    }
    /// A point of the Earth's own frame (x towards latitude and longitude 0, z towards the north pole, m) in this frame, m.
    pub fn world_from_ecef(&self, p: &Vector3<f64>) -> Point3<f64> {
        let off = p - self.origin_in_ecef;
        Point3::from(self.axes.map(|axis| axis.dot(&off)))
    }
    /// The place of a point of this frame (m).
    pub fn geodetic_from_world(&self, p: &Point3<f64>) -> Geodetic {
        let [east, north, up] = &self.axes;
        Geodetic::from_ecef(&(self.origin_in_ecef + east * p.x + north * p.y + up * p.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the world, over degrees of latitude and longitude and kilometres of height.
    const PLACES: [[f64; 3]; 6] = [
        [48.846_222, 2.346_414, 104.6],
        [-33.856_8, 151.215_3, -20.0],
        [0.0, -179.999_9, 0.0],
        [78.22, 15.65, 500.0],
        [-89.999_9, 40.0, 2800.0],
        [10.0, 100.0, 400_000.0],
    ];

    #[test]
    fn there_and_back_is_the_same_place() {
        for [lat, lon, height] in PLACES {
            let frame = LocalFrame::new(Geodetic::new(lat, lon, height).expect("a place"));
            for p in [[0.0, 0.0, 0.0], [1000.0, -2000.0, 30.0], [-9000.0, 500.0, -200.0]].map(Point3::from) {
                let place = frame.geodetic_from_world(&p);
                let off = (frame.world_from_geodetic(&place) - p).norm();
                assert!(off < 1e-6, "{off} m at {lat} {lon}");
            }
        }
    }

    /// By pyproj 3.7.2 (PROJ 9.5.1): `+proj=cart`, then `+proj=topocentric` around the origin.
    #[test]
    fn known_places_are_where_proj_says() {
        let frame = LocalFrame::new(Geodetic::new(48.846_222, 2.346_414, 104.6).expect("a place"));
        for (place, expected) in [
            ([48.85, 2.35, 60.0], [263.183_57, 420.149_43, -44.619_27]),
            ([48.8, 2.2, 150.0], [-10_756.445_40, -5_129.950_33, 34.282_21]),
            ([49.0, 2.5, 0.0], [11_238.149_60, 17_112.702_59, -137.461_86]),
        ] {
            let [lat, lon, height]: [f64; 3] = place;
            let found = frame.world_from_geodetic(&Geodetic::new(lat, lon, height).expect("a place"));
            assert!((found - Point3::from(expected)).norm() < 1e-4, "{place:?}: {found}");
        }
    }

    #[test]
    fn numbers_that_are_no_place_are_refused() {
        for [lat, lon, height] in [[90.1, 0.0, 0.0], [0.0, 180.5, 0.0], [f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::INFINITY]]
        {
            assert_eq!(Geodetic::new(lat, lon, height), None);
        }
    }
}
