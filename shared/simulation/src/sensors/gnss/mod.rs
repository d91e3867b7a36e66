//! The GNSS receiver: what the sky between the houses lets it know, once a second.
//!
//! | module | says |
//! |---|---|
//! | [`sky`] | where the satellites are |
//! | [`signal`] | what of them reaches the antenna, by ray casts into the scene |
//! | [`receiver`] | what a receiver measures and makes of it |
//! | [`solve`] | a position from ranges |
//! | [`geodesy`] | the world frame on the ellipsoid |

pub mod geodesy;
pub mod receiver;
pub mod signal;
pub mod sky;
pub mod solve;

pub use geodesy::{ORIGIN, geodetic_from_world};
pub use receiver::Receiver;

use crate::motion::Motion;
use crate::random::hash;
use crate::rig::GnssSpec;
use crate::scene::Scene;
use formats::nmea::{Fix, gga_from_fix, gga_without_fix, rmc_from_fix, rmc_without_fix};
use geodesy::GEOID_M;
use geometry::{Point3, Stamp, Vector3};
use rayon::prelude::*;
use receiver::Tracking;
use signal::{Antenna, Around, Signal};
use sky::{Satellite, Sky};
use std::fmt::Write;

/// Below this speed a receiver gives no course, m/s.
const LEAST_SPEED_MPS: f64 = 0.3;

/// One second of the receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// When.
    pub stamp: Stamp,
    /// What it says; `None` without a position.
    pub fix: Option<Fix>,
    /// Truth: satellites whose direct signals arrive.
    pub n_in_sight: u32,
    /// Truth: satellites in the solution that were received by way of a wall alone.
    pub n_reflected: u32,
    /// Truth: error of the position in the world frame, m.
    pub error: Option<Vector3<f64>>,
}

impl Epoch {
    /// The sentence with the date.
    pub fn rmc(&self) -> String {
        self.fix.map_or_else(|| rmc_without_fix(self.stamp), |fix| rmc_from_fix(&fix))
    }
    /// The sentence with the height.
    pub fn gga(&self) -> String {
        self.fix.map_or_else(|| gga_without_fix(self.stamp), |fix| gga_from_fix(&fix, GEOID_M))
    }
}

/// What the receiver says at the whole seconds of a drive.
pub fn record(scene: &Scene, motion: &Motion, spec: &GnssSpec, seconds: f64, seed: u64) -> Vec<Epoch> {
    let n = seconds as i64 + 1;
    // What arrives depends on the place alone; what the receiver makes of it depends on what was before.
    let received: Vec<Vec<(Satellite, Signal)>> =
        (0..n).into_par_iter().map(|i| receive(scene, motion, spec, i as f64, seed)).collect();
    let mut tracking = Tracking::new(spec.receiver, hash(seed, 2));
    received.iter().enumerate().map(|(i, signals)| epoch(motion, spec, &mut tracking, i as i64, signals)).collect()
}

fn receive(scene: &Scene, motion: &Motion, spec: &GnssSpec, at: f64, seed: u64) -> Vec<(Satellite, Signal)> {
    let around = Around(scene, scene.at(at));
    let antenna = (motion.pose(at) * Point3::from(spec.antenna_in_body)).coords;
    let antenna = Antenna::new(&around, antenna, motion.velocity(at), hash(hash(seed, 1), at as u64));
    let sky = Sky::new(hash(seed, 0));
    sky.above(at).into_iter().filter_map(|satellite| Some((satellite, antenna.receive(&satellite)?))).collect()
}

fn epoch(motion: &Motion, spec: &GnssSpec, tracking: &mut Tracking, i: i64, signals: &[(Satellite, Signal)]) -> Epoch {
    let (at, stamp) = (i as f64, motion.begin.plus_nanos(i * 1_000_000_000));
    let n_in_sight = signals.iter().filter(|(_, signal)| !signal.is_reflected).count() as u32;
    let Some(position) = tracking.next(signals) else {
        return Epoch { stamp, fix: None, n_in_sight, n_reflected: 0, error: None };
    };
    let antenna = motion.pose(at) * Point3::from(spec.antenna_in_body);
    let velocity = motion.velocity(at) + position.speed_error;
    let speed_mps = velocity.xy().norm();
    let [latitude_deg, longitude_deg, altitude_m] = geodetic_from_world(&(antenna.coords + position.error));
    let fix = Fix {
        stamp,
        position_deg: [latitude_deg, longitude_deg],
        altitude_m: Some(altitude_m),
        speed_mps: Some(speed_mps),
        course_deg: (speed_mps > LEAST_SPEED_MPS).then(|| velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0)),
        hdop: Some(position.hdop),
        satellites: position.used.len() as u32,
        quality: spec.receiver.quality(),
    };
    let n_reflected = position.used.iter().filter(|range| range.is_reflected).count() as u32;
    Epoch { stamp, fix: Some(fix), n_in_sight, n_reflected, error: Some(position.error) }
}

/// The log of all seconds.
pub fn nmea(epochs: &[Epoch]) -> String {
    let sentences = epochs.iter().flat_map(|epoch| [epoch.gga(), epoch.rmc()]);
    sentences.flat_map(|sentence| [sentence, "\r\n".to_owned()]).collect()
}

/// The truth about all seconds, for `truth/gnss.csv`; errors are empty where there was no position.
pub fn truth_csv(epochs: &[Epoch]) -> String {
    let mut text = "stamp,in_sight,reflected,east_m,north_m,up_m\n".to_owned();
    for epoch in epochs {
        let error = epoch.error.map_or_else(|| ",,".into(), |e| format!("{:.3},{:.3},{:.3}", e.x, e.y, e.z));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{error}", epoch.stamp.0, epoch.n_in_sight, epoch.n_reflected);
    }
    text
}
