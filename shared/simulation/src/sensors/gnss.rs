//! The GNSS receiver: a fix per second as GGA and RMC sentences, wrong by about a metre that wanders slowly.

use crate::motion::Motion;
use crate::random::{gauss, hash};
use crate::rig::ANTENNA_IN_BODY;
use formats::nmea::{Fix, gga_from_fix, rmc_from_fix};
use geometry::{Point3, Vector3};

/// Latitude, longitude (deg) and height above the ellipsoid (m) of the world's origin: the Pantheon in Paris.
pub const ORIGIN: [f64; 3] = [48.846_222, 2.346_414, 104.6];
/// Height of the geoid above the ellipsoid there, m; NMEA heights are above the geoid.
const GEOID_M: f64 = 44.6;
/// Error that wanders and noise of each fix, m.
const WANDER_M: f64 = 0.8;
/// See [`WANDER_M`].
const NOISE_M: f64 = 0.15;
/// How much of the wandering error stays after a second.
const MEMORY: f64 = 0.97;
/// WGS84: half the larger axis in m, and squared eccentricity.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// See [`SEMI_MAJOR_M`].
const ECCENTRICITY2: f64 = 6.694_379_990_141_33e-3;

/// The fixes of a drive, at its whole seconds.
pub fn record(motion: &Motion, seconds: f64, seed: u64) -> Vec<Fix> {
    let draw = |i: i64, kind: u64| {
        Vector3::from_fn(|axis, _| f64::from(gauss(hash(seed ^ kind, (i + 1) as u64 * 3 + axis as u64))))
    };
    let mut wander = draw(-1, 1) * WANDER_M;
    (0..=seconds as i64)
        .map(|i| {
            let at = i as f64;
            let error = wander + draw(i, 2) * NOISE_M;
            wander = wander * MEMORY + draw(i, 1) * (WANDER_M * (1.0 - MEMORY * MEMORY).sqrt());
            let antenna = motion.pose(at) * Point3::from(ANTENNA_IN_BODY);
            let velocity = motion.velocity(at);
            // Heights are half as good again.
            let measured = antenna.coords + error.component_mul(&Vector3::new(1.0, 1.0, 1.5));
            let [latitude_deg, longitude_deg, altitude_m] = geodetic_from_world(&measured);
            Fix {
                stamp: motion.begin.plus_nanos(i * 1_000_000_000),
                position_deg: [latitude_deg, longitude_deg],
                altitude_m: Some(altitude_m),
                speed_mps: Some(velocity.xy().norm()),
                course_deg: Some(velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0)),
                hdop: Some(0.9),
                satellites: 9,
                quality: 1,
            }
        })
        .collect()
}

/// Latitude, longitude (deg) and height (m) of a point in the world frame around [`ORIGIN`].
pub fn geodetic_from_world(p: &Vector3<f64>) -> [f64; 3] {
    let (lat, lon) = (ORIGIN[0].to_radians(), ORIGIN[1].to_radians());
    let (east, north) = (Vector3::new(-lon.sin(), lon.cos(), 0.0), {
        Vector3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos())
    });
    let up = east.cross(&north);
    let earth = ecef(ORIGIN) + east * p.x + north * p.y + up * p.z;
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

fn ecef([lat, lon, height]: [f64; 3]) -> Vector3<f64> {
    let (lat, lon) = (lat.to_radians(), lon.to_radians());
    let radius = SEMI_MAJOR_M / (1.0 - ECCENTRICITY2 * lat.sin().powi(2)).sqrt();
    Vector3::new(
        (radius + height) * lat.cos() * lon.cos(),
        (radius + height) * lat.cos() * lon.sin(),
        (radius * (1.0 - ECCENTRICITY2) + height) * lat.sin(),
    )
}

/// The log of all fixes.
pub fn nmea(fixes: &[Fix]) -> String {
    let sentences = fixes.iter().flat_map(|fix| [gga_from_fix(fix, GEOID_M), rmc_from_fix(fix)]);
    sentences.flat_map(|sentence| [sentence, "\r\n".to_owned()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example;
    use geometry::Stamp;

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
    }

    #[test]
    fn the_log_says_what_was_measured() {
        // RMC gives the year in two digits: the date must be of this century.
        let begin = Stamp(1_622_541_600_000_000_000);
        let motion = example(begin, 110.0);
        let fixes = record(&motion, 10.0, 9);
        let (read, stats) = formats::nmea::fixes(nmea(&fixes).as_bytes());
        assert_eq!((read.len(), stats.sentences, stats.bad_lines), (11, 22, 0));
        for (read, fix) in read.iter().zip(&fixes) {
            assert_eq!(read.stamp, fix.stamp);
            // A millionth of a minute of arc is 2 mm.
            let off = (0..2).map(|axis| (read.position_deg[axis] - fix.position_deg[axis]).abs());
            assert!(off.into_iter().all(|off| off < 1e-6 / 60.0));
            let altitude = |fix: &Fix| fix.altitude_m.expect("GGA has one");
            assert!((altitude(read) - altitude(fix)).abs() < 1e-3);
        }
    }

    #[test]
    fn fixes_are_about_a_metre_off_and_no_more() {
        let motion = example(Stamp(0), 110.0);
        let fixes = record(&motion, 100.0, 9);
        assert_eq!(fixes.len(), 101);
        let errors: Vec<f64> = fixes
            .iter()
            .enumerate()
            .map(|(i, fix)| {
                let truth = geodetic_from_world(&(motion.pose(i as f64) * Point3::from(ANTENNA_IN_BODY)).coords);
                let [latitude, longitude] = fix.position_deg;
                ((latitude - truth[0]) * 111_201.0).hypot((longitude - truth[1]) * 73_361.0)
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!((0.2..2.0).contains(&mean), "{mean}");
        assert!(errors.iter().all(|e| *e < 4.0));
    }
}
