//! A drive of two minutes with turns, its sensors, and its path as a table.

use drive::imu::ImuSample;
use drive::manifest::{TrajectoryEntry, TrajectoryFormat};
use formats::gps_time::week_seconds_from_unix;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Stamp, Translation3, UnitQuaternion, Vector3};
use given_path::{Evidence, Findings, GivenPath, check};
use lidar::nmea::Fix;
use std::fmt::Write;

/// 2024-09-13 12:26:40 UTC.
pub const START_S: f64 = 1_726_230_400.0;
pub const SECONDS: f64 = 120.0;
pub const ORIGIN: [f64; 3] = [48.846_222, 2.346_414, 104.6];
/// The path starts before the drive and ends after it, s.
pub const MARGIN_S: f64 = 40.0;
const ROLL: f64 = 0.044;
const PITCH: f64 = 0.035;
const SPEED_MPS: f64 = 8.0;
const STEP_S: f64 = 0.01;

/// Heading of the vehicle, counterclockwise from east, rad.
fn yaw(s: f64) -> f64 {
    0.5 + 0.8 * (0.15 * s).sin() + 0.3 * (0.41 * s).sin()
}

/// Poses from `MARGIN_S` before the drive to `MARGIN_S` after it, 10 ms apart.
pub fn poses() -> Vec<(f64, Pose)> {
    let n = ((SECONDS + 2.0 * MARGIN_S) / STEP_S) as usize;
    let mut position = Vector3::new(0.0, 0.0, 0.0);
    let mut poses = Vec::new();
    for index in 0..=n {
        let s = index as f64 * STEP_S - MARGIN_S;
        let rotation = UnitQuaternion::from_euler_angles(ROLL, -PITCH, yaw(s));
        poses.push((s, Isometry3::from_parts(Translation3::from(position), rotation)));
        let ahead = yaw(s + STEP_S / 2.0);
        position += Vector3::new(ahead.cos(), ahead.sin(), 0.0) * SPEED_MPS * STEP_S;
    }
    poses
}

pub fn local_frame() -> LocalFrame {
    LocalFrame::new(Geodetic::new(ORIGIN[0], ORIGIN[1], ORIGIN[2]).expect("a position"))
}

/// What the sensors of the drive measured.
pub fn evidence() -> Evidence {
    evidence_of_part(0.0, SECONDS)
}

/// What the sensors measured from `begin_s` to `end_s`.
pub fn evidence_of_part(begin_s: f64, end_s: f64) -> Evidence {
    let poses = poses();
    let within: Vec<&(f64, Pose)> = poses.iter().filter(|(s, _)| (begin_s..=end_s).contains(s)).collect();
    let stamp = |s: f64| Stamp(((START_S + s) * 1e3).round() as i64 * 1_000_000);
    let sample = |triple: &[&(f64, Pose)]| {
        let [(_, before), (s, a), (_, b)] = triple else { panic!("triples") };
        let rate = (a.rotation.inverse() * b.rotation).scaled_axis() / STEP_S;
        let [p, q, r] = [before, a, b].map(|pose| pose.translation.vector);
        let acceleration = (p - q * 2.0 + r) / (STEP_S * STEP_S);
        let force = a.rotation.inverse() * (Vector3::z() * 9.81 + acceleration);
        ImuSample { stamp: stamp(*s), acceleration: force.into(), angular_rate: rate.into() }
    };
    let fix = |(s, pose): &&(f64, Pose)| {
        let place = local_frame().geodetic_from_world(&Point3::from(pose.translation.vector));
        Fix {
            stamp: stamp(*s),
            position_deg: [place.latitude_deg, place.longitude_deg],
            altitude_m: Some(place.altitude_m),
            speed_mps: None,
            course_deg: None,
            hdop: Some(1.0),
            satellites: 9,
            quality: 1,
            vdop: None,
            deviation: None,
        }
    };
    Evidence {
        first: Some(stamp(begin_s)),
        last: Some(stamp(end_s)),
        imu: within.windows(3).map(sample).collect(),
        fixes: within.iter().step_by(100).map(fix).collect(),
        antenna_in_body: Point3::origin(),
    }
}

/// A line of the table: seconds of the GPS week, latitude, longitude, height, roll, pitch, heading (degrees, compass).
pub type Row = [f64; 7];

/// The true path, 50 poses a second.
pub fn rows() -> Vec<Row> {
    let row = |(s, pose): &(f64, Pose)| {
        let place = local_frame().geodetic_from_world(&Point3::from(pose.translation.vector));
        let heading_deg = 90.0 - yaw(*s).to_degrees();
        [
            week_seconds_from_unix(START_S + s),
            place.latitude_deg,
            place.longitude_deg,
            place.altitude_m,
            ROLL.to_degrees(),
            PITCH.to_degrees(),
            heading_deg.rem_euclid(360.0),
        ]
    };
    poses().iter().step_by(2).map(row).collect()
}

pub const NAMES: &str = "GPSTime,Latitude,Longitude,H-Ell,Roll,Pitch,Heading";

pub fn entry() -> TrajectoryEntry {
    TrajectoryEntry::new("path.csv", TrajectoryFormat::Table)
}

/// Reads a table of these rows.
pub fn read(names: &str, rows: &[Row], entry: &TrajectoryEntry) -> Result<GivenPath, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = format!("{names}\n");
    for row in rows {
        let fields: Vec<String> = row.iter().map(|value| format!("{value:.10}")).collect();
        writeln!(text, "{}", fields.join(",")).expect("writes");
    }
    std::fs::write(folder.path().join(&entry.file), text).expect("writes");
    let first = evidence().first;
    let origin = Geodetic::new(ORIGIN[0], ORIGIN[1], ORIGIN[2]);
    GivenPath::read(folder.path(), entry, first, origin).map_err(|problem| problem.to_string())
}

/// Reads a table and compares it with the drive.
pub fn found(names: &str, rows: &[Row], entry: &TrajectoryEntry) -> Findings {
    check(&read(names, rows, entry).expect("is read"), &evidence())
}
