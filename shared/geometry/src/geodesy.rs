//! A local east-north-up frame on the WGS84 ellipsoid.

use crate::Pose;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Semi-major axis of the WGS84 ellipsoid, m (NIMA TR8350.2, table 3.1).
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Squared first eccentricity of the WGS84 ellipsoid, from the flattening 1 / 298.257223563.
const ECCENTRICITY2: f64 = 6.694_379_990_141_33e-3;

/// A geodetic position (WGS84).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geodetic {
    /// Latitude in degrees, north positive, -90 to 90.
    pub latitude_deg: f64,
    /// Longitude in degrees, east positive, -180 to 180.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub altitude_m: f64,
}

impl Geodetic {
    /// A position. `None` unless all numbers are finite and in range.
    pub fn new(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Option<Self> {
        let sound = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 && altitude_m.is_finite();
        sound.then_some(Self { latitude_deg, longitude_deg, altitude_m })
    }

    /// Earth-centered, earth-fixed coordinates (ECEF): x towards latitude and longitude 0, z towards the north pole, m.
    fn ecef(&self) -> Vector3<f64> {
        let lat = self.latitude_deg.to_radians();
        let lon = self.longitude_deg.to_radians();
        let radius = across_radius_m(lat);
        Vector3::new(
            (radius + self.altitude_m) * lat.cos() * lon.cos(),
            (radius + self.altitude_m) * lat.cos() * lon.sin(),
            (radius * (1.0 - ECCENTRICITY2) + self.altitude_m) * lat.sin(),
        )
    }

    fn from_ecef(p: &Vector3<f64>) -> Self {
        let across = p.x.hypot(p.y);
        // Fixed-point iteration of the latitude. Each round reduces the error by a factor of 0.0067, so six rounds leave less
        // than a nanometre from 10 km below to 1000 km above the ground. The height is measured along the normal, which also
        // works at the poles.
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

/// Prime-vertical radius of curvature at a latitude in rad, m.
fn across_radius_m(lat: f64) -> f64 {
    SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * lat.sin().powi(2)).sqrt()
}

/// The world frame of a georeferenced drive: east, north and up at an origin (`docs/reference/conventions.md`). It is a
/// Cartesian frame, not a map projection: 1 km from the origin the ellipsoid lies 8 cm below the horizontal plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    origin_in_ecef: Vector3<f64>,
    /// East, north, up.
    axes: [Vector3<f64>; 3],
}

impl LocalFrame {
    /// The frame with its origin at a position.
    pub fn new(origin: Geodetic) -> Self {
        let lat = origin.latitude_deg.to_radians();
        let lon = origin.longitude_deg.to_radians();
        let east = Vector3::new(-lon.sin(), lon.cos(), 0.0);
        let north = Vector3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos());
        Self { origin, origin_in_ecef: origin.ecef(), axes: [east, north, east.cross(&north)] }
    }
    /// Origin of the frame.
    pub const fn origin(&self) -> Geodetic {
        self.origin
    }
    /// A geodetic position in this frame, m.
    pub fn world_from_geodetic(&self, place: &Geodetic) -> Point3<f64> {
        self.world_from_ecef(&place.ecef())
    }
    /// An ECEF point (x towards latitude and longitude 0, z towards the north pole, m) in this frame, m.
    pub fn world_from_ecef(&self, p: &Vector3<f64>) -> Point3<f64> {
        let off = p - self.origin_in_ecef;
        Point3::from(self.axes.map(|axis| axis.dot(&off)))
    }
    /// Rotation from the axes of another frame to the axes of this one: their verticals differ by the curvature of the
    /// Earth, and their norths by the convergence of the meridians.
    pub fn rotation_from(&self, other: &Self) -> UnitQuaternion<f64> {
        let columns = other.axes.map(|of_other| Vector3::from(self.axes.map(|axis| axis.dot(&of_other))));
        UnitQuaternion::from_basis_unchecked(&columns)
    }
    /// The pose of this frame in ECEF, m.
    pub fn ecef_from_world(&self) -> Pose {
        Pose::from_parts(self.origin_in_ecef.into(), UnitQuaternion::from_basis_unchecked(&self.axes))
    }
    /// Geodetic position of a point of this frame (m).
    pub fn geodetic_from_world(&self, p: &Point3<f64>) -> Geodetic {
        let [east, north, up] = &self.axes;
        Geodetic::from_ecef(&(self.origin_in_ecef + east * p.x + north * p.y + up * p.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Latitude (deg), longitude (deg) and height (m) of test positions around the world.
    const PLACES: [[f64; 3]; 6] = [
        [48.846_222, 2.346_414, 104.6],
        [-33.856_8, 151.215_3, -20.0],
        [0.0, -179.999_9, 0.0],
        [78.22, 15.65, 500.0],
        [-89.999_9, 40.0, 2800.0],
        [10.0, 100.0, 400_000.0],
    ];

    #[test]
    fn geodetic_round_trip_returns_the_same_point() {
        for [lat, lon, height] in PLACES {
            let frame = LocalFrame::new(Geodetic::new(lat, lon, height).expect("a position"));
            for p in [[0.0, 0.0, 0.0], [1000.0, -2000.0, 30.0], [-9000.0, 500.0, -200.0]].map(Point3::from) {
                let place = frame.geodetic_from_world(&p);
                assert!((frame.ecef_from_world() * p - place.ecef()).coords.norm() < 1e-6);
                let off = (frame.world_from_geodetic(&place) - p).norm();
                assert!(off < 1e-6, "{off} m at {lat} {lon}");
            }
        }
    }

    #[test]
    fn rotation_between_frames_agrees_with_their_points() {
        let frame = |lat, lon| LocalFrame::new(Geodetic::new(lat, lon, 50.0).expect("a position"));
        let [here, there] = [frame(48.846_222, 2.346_414), frame(48.9, 2.6)];
        let rotation = here.rotation_from(&there);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let moved = |p: Vector3<f64>| here.world_from_geodetic(&there.geodetic_from_world(&Point3::from(p)));
            let expected = (moved(axis * 10.0) - moved(axis * -10.0)) / 20.0;
            assert!((rotation * axis - expected).norm() < 1e-7, "{axis}");
        }
        assert!(rotation.angle() > 1e-3);
    }

    /// Reference values from pyproj 3.7.2 (PROJ 9.5.1): `+proj=cart`, then `+proj=topocentric` at the origin.
    #[test]
    fn local_coordinates_equal_proj() {
        let frame = LocalFrame::new(Geodetic::new(48.846_222, 2.346_414, 104.6).expect("a position"));
        for (place, expected) in [
            ([48.85, 2.35, 60.0], [263.183_57, 420.149_43, -44.619_27]),
            ([48.8, 2.2, 150.0], [-10_756.445_40, -5_129.950_33, 34.282_21]),
            ([49.0, 2.5, 0.0], [11_238.149_60, 17_112.702_59, -137.461_86]),
        ] {
            let [lat, lon, height]: [f64; 3] = place;
            let found = frame.world_from_geodetic(&Geodetic::new(lat, lon, height).expect("a position"));
            assert!((found - Point3::from(expected)).norm() < 1e-4, "{place:?}: {found}");
        }
    }

    #[test]
    fn out_of_range_positions_are_refused() {
        for [lat, lon, height] in [[90.1, 0.0, 0.0], [0.0, 180.5, 0.0], [f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::INFINITY]]
        {
            assert_eq!(Geodetic::new(lat, lon, height), None);
        }
    }
}
