//! Scores the placement of a recorded SLAM path of 6.5 km by recorded GNSS positions (`trajectories/slam_against_gnss`). Odometry and
//! positions are both recorded. Minutes are used and held out in turn: the positions of the held-out minutes score the result.
//!
//! `cargo run --release -p studies --example place_slam_path -- QUALITY`
//!
//! QUALITY: GGA quality of the positions (1 single, 2 differential, 4 RTK fixed).

#[path = "../../../shared/georeference/tests/suite/matched.rs"]
mod matched;

use anyhow::Context;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, UnitQuaternion, Vector3};
use georeference::{GeoreferenceSettings, Georeferencer};
use messages::GnssRow;
use nalgebra::Quaternion;
use registration::SweepMotion;

const FOLDER: &str = "trajectories/slam_against_gnss";
/// A submap is closed after this path, m.
const SUBMAP_M: f64 = 20.0;
/// Used and held-out parts, ns.
const PART_NANOS: i64 = 60_000_000_000;

struct Keyframe {
    stamp: i64,
    odom_from_body: Pose,
    p_in_world: Point3<f64>,
}

fn main() -> anyhow::Result<()> {
    let quality: u32 = std::env::args().nth(1).context("arguments: QUALITY")?.parse()?;
    let keyframes = keyframes()?;
    let origin = Geodetic::new(48.26, 11.67, 480.0).context("origin")?;
    let frame = LocalFrame::new(origin);
    let settings = GeoreferenceSettings {
        gnss: true,
        imu: false,
        loops: false,
        unsmooth_fixes: false,
        antenna_in_body: Point3::origin(),
        imu_in_body: Point3::origin(),
        origin: Some(origin),
        max_keyframes: 10,
    };
    let first = keyframes.first().context("no keyframes")?.stamp;
    let is_held_out = |stamp: i64| (stamp - first) / PART_NANOS % 2 == 1;
    let mut georeferencer = Georeferencer::new(&settings);
    let mut path_m = f64::INFINITY;
    // The keyframe at the start of each submap.
    let mut starts: Vec<&Keyframe> = Vec::new();
    for pair in keyframes.windows(2) {
        let [begin, end] = [&pair[0], &pair[1]];
        let place = frame.geodetic_from_world(&begin.p_in_world);
        let row = GnssRow {
            stamp: begin.stamp,
            latitude_deg: place.latitude_deg,
            longitude_deg: place.longitude_deg,
            altitude_m: place.altitude_m,
            speed_mps: -1.0,
            course_deg: -1.0,
            hdop: 1.0,
            satellites: 12,
            quality,
            ..GnssRow::default()
        };
        if !is_held_out(begin.stamp) {
            georeferencer.add_gnss(&[row], &settings);
        }
        let pose = begin.odom_from_body;
        if path_m >= SUBMAP_M {
            let upright = Isometry3::from_parts(pose.translation, geometry::heading(&pose.rotation));
            georeferencer.begin_submap(upright, begin.stamp);
            starts.push(begin);
            path_m = 0.0;
        }
        let translation = end.odom_from_body.translation.vector - pose.translation.vector;
        path_m += translation.norm();
        let rotation = (pose.rotation.inverse() * end.odom_from_body.rotation).scaled_axis();
        let motion = SweepMotion { mid: pose, translation, rotation };
        let mut registered = matched::registered(begin.stamp, (end.stamp - begin.stamp) as u32, motion, 2000, true);
        // The path has no inertial samples.
        registered.predicted_by.inertial = false;
        georeferencer.add_sweep(&registered, &pose, &end.odom_from_body);
        georeferencer.update(&settings);
    }
    let placed = georeferencer.solve(&settings).context("no submaps")?;
    println!("{}", placed.summary);
    for held_out in [false, true] {
        let mut squares = [0.0; 2];
        let mut stated = [0.0; 2];
        let mut normalized = [0.0; 2];
        let mut n = 0.0;
        for (row, start) in placed.rows.iter().zip(&starts).filter(|(row, _)| is_held_out(row.stamp) == held_out) {
            let pose: Pose = row.world_from_submap.to_pose().unwrap_or_default();
            let off: Vector3<f64> = pose.translation.vector - start.p_in_world.coords;
            let deviation = row.deviation();
            squares[0] += off.xy().norm_squared();
            squares[1] += off.z.powi(2);
            stated[0] += deviation.position_m.powi(2);
            stated[1] += deviation.height_m.powi(2);
            let off = pose.rotation.inverse() * off;
            let [x, y, z] = row.sigma_m.map(f64::from);
            normalized[0] += (off.x / x).hypot(off.y / y).powi(2) / 2.0;
            normalized[1] += (off.z / z).powi(2);
            n += 1.0;
        }
        let part = if held_out { "held-out minutes" } else { "used minutes" };
        let [across, up] = squares.map(|sum: f64| (sum / n).sqrt());
        let [a, u] = stated.map(|sum: f64| (sum / n).sqrt());
        let [x, z] = normalized.map(|sum: f64| sum / n);
        println!(
            "{part}: {n} submaps, {across:.2} m across, {up:.2} m up; stated {a:.2} {u:.2}; normalized {x:.2} {z:.2}"
        );
    }
    Ok(())
}

fn keyframes() -> anyhow::Result<Vec<Keyframe>> {
    let poses = numbers("poses_keyframes.txt")?;
    let positions = numbers("positions_interpolated.txt")?;
    anyhow::ensure!(poses.len() == positions.len(), "{} poses, {} positions", poses.len(), positions.len());
    let keyframe = |(pose, position): (&Vec<f64>, &Vec<f64>)| {
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(pose[7], pose[4], pose[5], pose[6]));
        Keyframe {
            stamp: pose[0] as i64,
            odom_from_body: Isometry3::from_parts(Vector3::new(pose[1], pose[2], pose[3]).into(), rotation),
            p_in_world: Point3::new(position[1], position[2], position[3]),
        }
    };
    Ok(poses.iter().zip(&positions).map(keyframe).collect())
}

fn numbers(name: &str) -> anyhow::Result<Vec<Vec<f64>>> {
    let path = real_data::find(&format!("{FOLDER}/{name}")).with_context(|| format!("{FOLDER}/{name} is absent"))?;
    let text = std::fs::read_to_string(&path)?;
    let line = |line: &str| line.split_whitespace().map(|word| Ok(word.parse()?)).collect::<anyhow::Result<Vec<f64>>>();
    text.lines().map(line).collect()
}
