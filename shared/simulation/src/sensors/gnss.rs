//! The GNSS receiver: a fix per second as GGA and RMC sentences, wrong by about a metre that wanders slowly.

use crate::motion::Motion;
use crate::random::{gauss, hash};
use crate::rig::ANTENNA_IN_BODY;
use geometry::{Point3, Stamp, Vector3};

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

/// One fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// When.
    pub stamp: Stamp,
    /// Latitude, longitude (deg) and height above the ellipsoid (m).
    pub position: [f64; 3],
    /// Over ground, m/s.
    pub speed_mps: f64,
    /// Over ground, deg clockwise from north.
    pub course_deg: f64,
}

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
            Fix {
                stamp: motion.begin.plus_nanos(i * 1_000_000_000),
                // Heights are half as good again.
                position: geodetic_from_world(&(antenna.coords + error.component_mul(&Vector3::new(1.0, 1.0, 1.5)))),
                speed_mps: velocity.xy().norm(),
                course_deg: velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0),
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

/// Fix as `$GPGGA`, without line end.
pub fn gga(fix: &Fix) -> String {
    let [lat, lon, height] = fix.position;
    let (msl, time) = (height - GEOID_M, Utc::of(fix.stamp).time());
    with_checksum(&format!(
        "GPGGA,{time},{},{},1,09,0.9,{msl:.3},M,{GEOID_M:.1},M,,",
        degrees(lat, 2, ['N', 'S']),
        degrees(lon, 3, ['E', 'W'])
    ))
}

/// Fix as `$GPRMC`, without line end.
pub fn rmc(fix: &Fix) -> String {
    let [lat, lon, _] = fix.position;
    let utc = Utc::of(fix.stamp);
    let (lat, lon) = (degrees(lat, 2, ['N', 'S']), degrees(lon, 3, ['E', 'W']));
    let knots = fix.speed_mps / 0.514_444;
    with_checksum(&format!("GPRMC,{},A,{lat},{lon},{knots:.3},{:.2},{},,,A", utc.time(), fix.course_deg, utc.date()))
}

/// The log of all fixes.
pub fn nmea(fixes: &[Fix]) -> String {
    fixes.iter().flat_map(|fix| [gga(fix), "\r\n".into(), rmc(fix), "\r\n".into()]).collect()
}

/// Degrees and decimal minutes to 2 mm, as `ddmm.mmmmmm,N`.
fn degrees(value: f64, digits: usize, [positive, negative]: [char; 2]) -> String {
    let side = if value < 0.0 { negative } else { positive };
    // In millionths of a minute, so that 59.9999996 minutes become the next degree.
    let total = (value.abs() * 60e6).round() as u64;
    let (whole, minutes) = (total / 60_000_000, total % 60_000_000);
    format!("{whole:0digits$}{:02}.{:06},{side}", minutes / 1_000_000, minutes % 1_000_000)
}

fn with_checksum(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}")
}

/// Calendar date and time of day.
struct Utc {
    year: i64,
    month: i64,
    day: i64,
    nanos: i64,
}

impl Utc {
    fn of(stamp: Stamp) -> Self {
        const DAY: i64 = 86_400_000_000_000;
        let (days, nanos) = (stamp.0.div_euclid(DAY), stamp.0.rem_euclid(DAY));
        // Days to civil date in eras of 400 years that begin on 1 March (H. Hinnant, "chrono-compatible date algorithms").
        let z = days + 719_468;
        let (era, of_era) = (z.div_euclid(146_097), z.rem_euclid(146_097));
        let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
        let day_of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let shifted = (5 * day_of_year + 2) / 153;
        let day = day_of_year - (153 * shifted + 2) / 5 + 1;
        let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
        Self { year: year_of_era + era * 400 + i64::from(month <= 2), month, day, nanos }
    }
    fn time(&self) -> String {
        let seconds = self.nanos / 1_000_000_000;
        let hundredths = self.nanos % 1_000_000_000 / 10_000_000;
        format!("{:02}{:02}{:02}.{hundredths:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
    }
    fn date(&self) -> String {
        format!("{:02}{:02}{:02}", self.day, self.month, self.year % 100)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Progress;
    use crate::scene::Street;

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
    fn sentences_have_the_known_form() {
        let fix = Fix {
            stamp: Stamp(1_622_541_600_000_000_000),
            position: [48.846_222, -2.346_414, 104.6],
            speed_mps: 8.0,
            course_deg: 84.5,
        };
        assert_eq!(gga(&fix), "$GPGGA,100000.00,4850.773320,N,00220.784840,W,1,09,0.9,60.000,M,44.6,M,,*43");
        assert!(rmc(&fix).starts_with("$GPRMC,100000.00,A,4850.773320,N,00220.784840,W,15.551,84.50,010621,,,A*"));
        // The sentence by which the format is usually explained.
        let known = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,";
        assert!(with_checksum(known).ends_with("*47"));
        for sentence in [gga(&fix), rmc(&fix)] {
            let (body, sum) = sentence[1..].split_once('*').expect("a checksum");
            assert_eq!(format!("{:02X}", body.bytes().fold(0, |s, b| s ^ b)), sum);
        }
    }

    #[test]
    fn fixes_are_about_a_metre_off_and_no_more() {
        let motion = Motion::new(Stamp(0), Progress { phase: 0.0 }, Street::new(1400.0, 0.0), -1.6);
        let fixes = record(&motion, 100.0, 9);
        assert_eq!(fixes.len(), 101);
        let errors: Vec<f64> = fixes
            .iter()
            .enumerate()
            .map(|(i, fix)| {
                let truth = geodetic_from_world(&(motion.pose(i as f64) * Point3::from(ANTENNA_IN_BODY)).coords);
                ((fix.position[0] - truth[0]) * 111_201.0).hypot((fix.position[1] - truth[1]) * 73_361.0)
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!((0.2..2.0).contains(&mean), "{mean}");
        assert!(errors.iter().all(|e| *e < 4.0));
    }
}
