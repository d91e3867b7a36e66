//! The world frame on the ellipsoid.

use geometry::Vector3;

/// Latitude, longitude (deg) and height above the ellipsoid (m) of the world's origin: the Pantheon in Paris.
pub const ORIGIN: [f64; 3] = [48.846_222, 2.346_414, 104.6];
/// Height of the geoid above the ellipsoid there, m; NMEA heights are above the geoid.
pub const GEOID_M: f64 = 44.6;
/// WGS84: half the larger axis in m, and squared eccentricity.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// See [`SEMI_MAJOR_M`].
const ECCENTRICITY2: f64 = 6.694_379_990_141_33e-3;

/// Latitude, longitude (deg) and height (m) of a point in the world frame around [`ORIGIN`].
pub fn geodetic_from_world(p: &Vector3<f64>) -> [f64; 3] {
    let earth = ecef_from_world(p);
    let lon = earth.y.atan2(earth.x);
    let across = earth.x.hypot(earth.y);
    // Fixed point of Bowring's angle; five rounds reach a nanometre near the ground.
    let (mut lat, mut height) = ((earth.z / (across * (1.0 - ECCENTRICITY2))).atan(), 0.0);
    for _ in 0..5 {
        let radius = SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * lat.sin().powi(2)).sqrt();
        height = across / lat.cos() - radius;
        lat = (earth.z / (across * (1.0 - ECCENTRICITY2 * radius / (radius + height)))).atan();
    }
    [lat.to_degrees(), lon.to_degrees(), height]
}

/// A point of the world frame in the Earth's own (x towards latitude 0, longitude 0; z north), m.
pub fn ecef_from_world(p: &Vector3<f64>) -> Vector3<f64> {
    let [east, north, up] = axes();
    ecef(ORIGIN) + east * p.x + north * p.y + up * p.z
}

/// A point of the Earth's frame in the world frame, m.
pub fn world_from_ecef(p: &Vector3<f64>) -> Vector3<f64> {
    let off = p - ecef(ORIGIN);
    Vector3::from(axes().map(|axis| axis.dot(&off)))
}

/// East, north and up at the origin, in the Earth's frame.
fn axes() -> [Vector3<f64>; 3] {
    let (lat, lon) = (ORIGIN[0].to_radians(), ORIGIN[1].to_radians());
    let east = Vector3::new(-lon.sin(), lon.cos(), 0.0);
    let north = Vector3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos());
    [east, north, east.cross(&north)]
}

fn ecef([lat, lon, height]: [f64; 3]) -> Vector3<f64> {
    let (lat, lon) = (lat.to_radians(), lon.to_radians());
    let radius = SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * lat.sin().powi(2)).sqrt();
    Vector3::new(
        (radius + height) * lat.cos() * lon.cos(),
        (radius + height) * lat.cos() * lon.sin(),
        (radius * (1.0 - ECCENTRICITY2) + height) * lat.sin(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_world_is_metric_around_its_origin() {
        let at = geodetic_from_world(&Vector3::zeros());
        assert!(at.iter().zip(ORIGIN).all(|(a, b)| (a - b).abs() < 1e-9));
        // One degree of latitude is 111.2 km here, one of longitude 73.3 km.
        let north = geodetic_from_world(&Vector3::new(0.0, 100.0, 0.0));
        assert!(((north[0] - ORIGIN[0]) * 111_201.0 - 100.0).abs() < 0.05);
        let east = geodetic_from_world(&Vector3::new(100.0, 0.0, 3.0));
        assert!(((east[1] - ORIGIN[1]) * 73_361.0 - 100.0).abs() < 0.1);
        assert!((east[2] - ORIGIN[2] - 3.0).abs() < 0.01);
        let p = Vector3::new(-300.0, 20.0, 7.0);
        assert!((world_from_ecef(&ecef_from_world(&p)) - p).norm() < 1e-6);
    }
}
