//! GNSS receiver: one fix per second from the satellites visible between the houses.
//!
//! | module | content |
//! |---|---|
//! | [`sky`] | satellite positions |
//! | [`signal`] | signals at the antenna: line of sight, attenuation and multipath, by ray casts |
//! | [`receiver`] | code ranges with errors, and the position filter |
//! | [`solve`] | position from code ranges |
//! | [`place`] | geodetic origin of the world frame |

pub mod place;
pub mod receiver;
pub mod signal;
pub mod sky;
pub mod solve;

pub use place::ORIGIN;
pub use receiver::{GnssSpec, Receiver};

use crate::motion::Motion;
use geometry::{Geodetic, Point3, Stamp, Vector3};
use lidar::nmea::{Fix, gga_from_fix, gga_without_fix, rmc_from_fix, rmc_without_fix};
use place::{GEOID_M, world};
use random::hash;
use rayon::prelude::*;
use receiver::{ReceivedSignal, Tracking};
use signal::{Antenna, Surroundings, TownAtTime};
use sky::Sky;
use std::fmt::Write;
use town::Scene;

/// Least speed with a valid course, m/s.
const LEAST_SPEED_MPS: f64 = 0.3;

/// Output of one second, with its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// Stamp.
    pub stamp: Stamp,
    /// The fix; `None` without a position.
    pub fix: Option<Fix>,
    /// Ground truth: number of satellites with a direct signal.
    pub n_in_sight: u32,
    /// Ground truth: number of satellites in the solution that were received only by reflection.
    pub n_reflected: u32,
    /// Ground truth: error of the position in the world frame, m.
    pub error: Option<Vector3<f64>>,
}

impl Epoch {
    /// The RMC sentence.
    pub fn rmc(&self) -> String {
        self.fix.map_or_else(|| rmc_without_fix(self.stamp), |fix| rmc_from_fix(&fix))
    }
    /// The GGA sentence.
    pub fn gga(&self) -> String {
        self.fix.map_or_else(|| gga_without_fix(self.stamp), |fix| gga_from_fix(&fix, GEOID_M))
    }
}

/// Epochs of a drive, one per second.
pub fn record(scene: &Scene, motion: &Motion, spec: &GnssSpec, seconds: f64, seed: u64) -> Vec<Epoch> {
    record_in(|at| TownAtTime { scene, snapshot: scene.at(at) }, motion, spec, seconds, seed)
}

fn record_in<S: Surroundings>(
    around: impl Fn(f64) -> S + Sync,
    motion: &Motion,
    spec: &GnssSpec,
    seconds: f64,
    seed: u64,
) -> Vec<Epoch> {
    let n = seconds as i64 + 1;
    let sky = Sky::new(hash(seed, 0));
    let receive = |i: i64| {
        let at = i as f64;
        let noise = hash(hash(seed, 1), i as u64);
        let antenna_in_body = Point3::from(spec.antenna_in_body);
        let place = (motion.pose(at) * antenna_in_body).coords;
        let around = around(at);
        let antenna = Antenna::new(&around, place, motion.velocity_of(&antenna_in_body, at), noise);
        let received = |satellite| Some(ReceivedSignal { signal: antenna.receive(&satellite)?, satellite });
        sky.above(at).into_iter().filter_map(received).collect()
    };
    // Signals depend only on the position and are computed in parallel; the receiver has state.
    let received: Vec<Vec<ReceivedSignal>> = (0..n).into_par_iter().map(receive).collect();
    let mut tracking = Tracking::new(spec.receiver, hash(seed, 2));
    received.iter().enumerate().map(|(i, signals)| epoch(motion, spec, &mut tracking, i as i64, signals)).collect()
}

fn epoch(motion: &Motion, spec: &GnssSpec, tracking: &mut Tracking, i: i64, signals: &[ReceivedSignal]) -> Epoch {
    let at = i as f64;
    let stamp = motion.begin.plus_nanos(i * 1_000_000_000);
    let n_in_sight = signals.iter().filter(|received| !received.signal.is_reflected).count() as u32;
    let Some(position) = tracking.next(signals) else {
        return Epoch { stamp, fix: None, n_in_sight, n_reflected: 0, error: None };
    };
    let antenna_in_body = Point3::from(spec.antenna_in_body);
    let antenna = motion.pose(at) * antenna_in_body;
    // Doppler shifts give the velocity of the antenna, not of the body origin. In a turn, 1.2 m behind it, the two differ
    // by 0.4 m/s.
    let velocity = motion.velocity_of(&antenna_in_body, at) + position.speed_error;
    let speed_mps = velocity.xy().norm();
    let Geodetic { latitude_deg, longitude_deg, altitude_m } = world().geodetic_from_world(&(antenna + position.error));
    let fix = Fix {
        stamp,
        position_deg: [latitude_deg, longitude_deg],
        altitude_m: Some(altitude_m),
        speed_mps: Some(speed_mps),
        course_deg: (speed_mps > LEAST_SPEED_MPS).then(|| velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0)),
        hdop: Some(position.hdop),
        satellites: position.used.len() as u32,
        quality: spec.receiver.quality(),
        vdop: None,
        deviation: None,
    };
    let n_reflected = position.used.iter().filter(|range| range.is_reflected).count() as u32;
    Epoch { stamp, fix: Some(fix), n_in_sight, n_reflected, error: Some(position.error) }
}

/// NMEA log of all epochs.
pub fn nmea(epochs: &[Epoch]) -> String {
    let sentences = epochs.iter().flat_map(|epoch| [epoch.gga(), epoch.rmc()]);
    sentences.flat_map(|sentence| [sentence, "\r\n".to_owned()]).collect()
}

/// Ground truth of all epochs, for `truth/gnss.csv`. Errors are empty without a position.
pub fn truth_csv(epochs: &[Epoch]) -> String {
    let mut text = "stamp,in_sight,reflected,east_m,north_m,up_m\n".to_owned();
    for epoch in epochs {
        let error = epoch.error.map_or_else(|| ",,".into(), |e| format!("{:.3},{:.3},{:.3}", e.x, e.y, e.z));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{error}", epoch.stamp.0, epoch.n_in_sight, epoch.n_reflected);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example;
    use raytrace::{Ray, Vec3};
    use signal::SurfaceHit;

    /// Endless walls along the street: distance from its center line and height, m. With height 0 there are no walls.
    #[derive(Clone, Copy)]
    struct Canyon {
        half_width: f32,
        height: f32,
    }

    impl Surroundings for Canyon {
        fn is_blocked(&self, ray: &Ray, max_m: f32) -> bool {
            self.nearest(ray, max_m).is_some()
        }
        fn nearest(&self, ray: &Ray, max_m: f32) -> Option<SurfaceHit> {
            let side = ray.direction.y.signum();
            let range = (side * self.half_width - ray.origin.y) / ray.direction.y;
            let hits = range > 0.0 && range < max_m && ray.at(range).z < self.height;
            hits.then(|| SurfaceHit { range_m: range, normal: Vec3::new(0.0, -side, 0.0) })
        }
    }

    const FIELD: Canyon = Canyon { half_width: 20.0, height: -1e6 };

    struct Underground {
        /// Whether there is a hill overhead.
        has_hill: bool,
    }

    impl Surroundings for Underground {
        fn is_blocked(&self, _: &Ray, _: f32) -> bool {
            self.has_hill
        }
        fn nearest(&self, ray: &Ray, _: f32) -> Option<SurfaceHit> {
            self.has_hill.then(|| SurfaceHit { range_m: 5.0, normal: -ray.direction })
        }
    }

    fn motion() -> Motion {
        // RMC gives the year in two digits: the date must be of this century.
        let begin = Stamp(1_622_541_600_000_000_000);
        // Along the x axis for the first 25 s.
        example(begin, 60.0)
    }

    fn spec(receiver: Receiver) -> GnssSpec {
        GnssSpec { receiver, antenna_in_body: [-1.2, 0.3, 1.75] }
    }

    fn drives(around: Canyon, receiver: Receiver) -> Vec<Vec<Epoch>> {
        let motion = motion();
        let spec = spec(receiver);
        (0..30).map(|seed| record_in(|_| around, &motion, &spec, 20.0, seed)).collect()
    }

    /// Root mean square of the horizontal and the vertical errors, m.
    fn rms(drives: &[Vec<Epoch>]) -> [f64; 2] {
        let errors: Vec<Vector3<f64>> = drives.iter().flatten().filter_map(|epoch| epoch.error).collect();
        let mean = |of: &dyn Fn(&Vector3<f64>) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
        [mean(&|e| e.xy().norm_squared()).sqrt(), mean(&|e| e.z * e.z).sqrt()]
    }

    #[test]
    fn open_sky_errors_have_stated_size_and_drift_slowly() {
        for (receiver, range) in [(Receiver::SingleFrequency, 0.8..2.0), (Receiver::Differential, 0.1..0.4)] {
            let drives = drives(FIELD, receiver);
            let epochs = || drives.iter().flatten();
            assert!(epochs().count() > 600 && epochs().all(|epoch| epoch.fix.is_some()), "{}", epochs().count());
            let [across, up] = rms(&drives);
            assert!(range.contains(&across) && up > across, "{receiver:?}: {across} m, {up} m");
            let steps = drives
                .iter()
                .flat_map(|drive| drive.windows(2))
                .map(|pair| (pair[1].error.expect("a fix") - pair[0].error.expect("a fix")).xy().norm_squared());
            let step = (steps.sum::<f64>() / 600.0).sqrt();
            assert!(step < 0.3 * across, "{receiver:?}: {step} m from second to second");
        }
    }

    /// Bias that drives of some minutes cannot average out; `lab/notebook/georeferencing.md` quotes it.
    #[test]
    fn one_minute_mean_keeps_a_bias() {
        let motion = motion();
        let spec = spec(Receiver::Differential);
        let mean = |seed: u64| {
            let epochs = record_in(|_| FIELD, &motion, &spec, 59.0, seed);
            epochs.iter().filter_map(|epoch| epoch.error).sum::<Vector3<f64>>() / epochs.len() as f64
        };
        let means: Vec<Vector3<f64>> = (0..200).map(mean).collect();
        let rms = |square: fn(&Vector3<f64>) -> f64| (means.iter().map(square).sum::<f64>() / 200.0).sqrt();
        let across = rms(|m| m.xy().norm_squared());
        let up = rms(|m| m.z * m.z);
        let n_within = |is: fn(&Vector3<f64>) -> bool| means.iter().filter(|m| is(m)).count();
        let n_across = n_within(|m| m.xy().norm() < 0.5);
        let n_up = n_within(|m| m.z.abs() < 0.5);
        println!(
            "means are {across:.2} m off across and {up:.2} m in height, within 0.5 m under {n_across} and {n_up} of 200 skies"
        );
        assert!((0.15..0.35).contains(&across) && (0.35..0.65).contains(&up), "{across} m, {up} m");
    }

    #[test]
    fn street_canyon_has_fewer_satellites_and_larger_errors() {
        let canyon = Canyon { half_width: 20.0, height: motion().pose(10.0).translation.z as f32 + 25.0 };
        let open = drives(FIELD, Receiver::SingleFrequency);
        let narrow = drives(canyon, Receiver::SingleFrequency);
        let in_sight = |drives: &[Vec<Epoch>]| drives.iter().flatten().map(|e| f64::from(e.n_in_sight)).sum::<f64>();
        assert!(in_sight(&narrow) < 0.75 * in_sight(&open), "{} {}", in_sight(&narrow), in_sight(&open));
        let [before, _] = rms(&open);
        let [after, _] = rms(&narrow);
        assert!(after > 1.5 * before && after < 30.0, "{before} m, {after} m");
        assert!(narrow.iter().flatten().any(|epoch| epoch.n_reflected > 0));
        let hdop = |drives: &[Vec<Epoch>]| drives[0][15].fix.and_then(|fix| fix.hdop).unwrap_or(99.0);
        assert!(hdop(&narrow) > hdop(&open));
    }

    #[test]
    fn tunnel_gives_an_outage_in_the_nmea_log() {
        let motion = motion();
        let spec = spec(Receiver::SingleFrequency);
        let tunnel = |at: f64| Underground { has_hill: (20.0..28.0).contains(&at) };
        let epochs = record_in(tunnel, &motion, &spec, 40.0, 3);
        let without: Vec<usize> = (0..epochs.len()).filter(|i| epochs[*i].fix.is_none()).collect();
        assert_eq!(without, (20..28).collect::<Vec<_>>());
        let (read, stats) = lidar::nmea::fixes(nmea(&epochs).as_bytes());
        assert_eq!((read.len(), stats.sentences, stats.bad_lines, stats.without_fix), (33, 82, 0, 8));
        assert!(epochs[28].error.expect("a fix").norm() < 10.0);
        assert_eq!(truth_csv(&epochs).lines().filter(|line| line.ends_with(",,")).count(), 8);
    }

    #[test]
    fn nmea_log_contains_the_fixes() {
        let motion = motion();
        let spec = spec(Receiver::Differential);
        let epochs = record_in(|_| FIELD, &motion, &spec, 10.0, 9);
        let (read, stats) = lidar::nmea::fixes(nmea(&epochs).as_bytes());
        assert_eq!((read.len(), stats.sentences, stats.bad_lines), (11, 22, 0));
        for (i, (read, epoch)) in read.iter().zip(&epochs).enumerate() {
            let fix = epoch.fix.expect("an open sky");
            assert_eq!((read.stamp, read.satellites, read.quality), (fix.stamp, fix.satellites, 2));
            // A millionth of a minute of arc is 2 mm.
            let off = (0..2).map(|axis| (read.position_deg[axis] - fix.position_deg[axis]).abs());
            assert!(off.into_iter().all(|off| off < 1e-6 / 60.0));
            let altitude = |fix: &Fix| fix.altitude_m.expect("GGA has one");
            assert!((altitude(read) - altitude(&fix)).abs() < 1e-3);
            // The truth error equals the error of the fix.
            let antenna = motion.pose(i as f64) * Point3::from(spec.antenna_in_body);
            let Geodetic { latitude_deg, longitude_deg, altitude_m } = world().geodetic_from_world(&antenna);
            let error = epoch.error.expect("an open sky");
            assert!(((fix.position_deg[0] - latitude_deg) * 111_201.0 - error.y).abs() < 0.01);
            assert!(((fix.position_deg[1] - longitude_deg) * 73_361.0 - error.x).abs() < 0.01);
            assert!((altitude(&fix) - altitude_m - error.z).abs() < 0.01);
        }
        // A stationary vehicle has no course.
        let has_course = |i: usize| epochs[i].fix.is_some_and(|fix| fix.course_deg.is_some());
        assert!(!has_course(0) && has_course(10));
    }

    /// Regression: the fix had the velocity of the body origin, which differs by 0.4 m/s in turns.
    #[test]
    fn fix_velocity_is_that_of_the_antenna() {
        let motion = motion();
        let spec = spec(Receiver::Differential);
        let antenna = Point3::from(spec.antenna_in_body);
        // In the first turn.
        let at = 34;
        let [expected, of_body] = [motion.velocity_of(&antenna, at as f64), motion.velocity(at as f64)];
        let reported = |seed: u64| {
            let fix = record_in(|_| FIELD, &motion, &spec, 35.0, seed)[at].fix.expect("an open sky");
            let (east, north) = fix.course_deg.expect("it drives").to_radians().sin_cos();
            Vector3::new(east, north, 0.0) * fix.speed_mps.expect("it drives")
        };
        let mean = (0..30).map(reported).sum::<Vector3<f64>>() / 30.0;
        let off = (mean - expected).xy().norm();
        assert!(off < 0.1 * (of_body - expected).xy().norm(), "{off} m/s");
    }
}
