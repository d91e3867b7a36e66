//! Faults of the LiDAR, the inertial unit and the receiver.

use crate::support::{Copied, Sample, doubts, turn, with_turns};
use drive::Drive;
use drive::manifest::PoseEntry;
use geometry::{Pose, UnitQuaternion, Vector3};
use registration::SpinDirection;
use rig::survey::SurveySettings;
use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;

#[test]
fn right_rig_has_no_doubt() {
    assert_eq!(Copied::from_recorded(with_turns()).doubts(), [""; 0]);
}

#[test]
fn wrong_mounting_of_the_lidar_is_found() {
    let turned = |axis, degrees| {
        let mut copied = Copied::from_recorded(with_turns());
        turn(&mut copied.manifest.lidar.body_from_lidar, axis, degrees, true);
        copied.doubts()
    };
    assert_eq!(turned(Vector3::y(), 6.0), ["lidar level"]);
    assert_eq!(turned(Vector3::z(), 8.0), ["lidar heading"]);
    assert_eq!(turned(Vector3::z(), 90.0), ["lidar heading"]);
    let mut copied = Copied::from_recorded(with_turns());
    copied.manifest.lidar.body_from_lidar.translation[2] += 5.0;
    assert_eq!(copied.doubts(), ["lidar height"]);
}

/// The drive as KITTI sweeps without times, cut at the rear. `is_mirrored`: left and right are exchanged.
fn as_clouds(is_mirrored: bool) -> Copied {
    let mut copied = Copied::from_recorded(with_turns());
    let drive = Drive::open(&with_turns().path()).expect("a drive");
    let mut source = drive.sweeps().expect("opens");
    let mut times = String::new();
    let folder = copied.replaced("lidar");
    fs::create_dir(&folder).expect("made");
    for index in 0.. {
        let mut bytes = Vec::new();
        let sense = if is_mirrored { 1.0 } else { -1.0 };
        let sweep = source.next_sweep(|points| {
            for point in points {
                let values = [-point.x, sense * point.y, point.z, f32::from(point.intensity) / 255.0];
                bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            }
        });
        let Some(sweep) = sweep.expect("reads") else { break };
        // The last sweep is cut short.
        if sweep.turn > 0.9 {
            fs::write(folder.join(format!("{index:06}.bin")), bytes).expect("writes");
            // Clouds without point times have the stamp of the middle of the sweep.
            writeln!(times, "{}", sweep.stamp.0 + i64::from(sweep.duration_nanos / 2)).expect("a text");
        }
    }
    fs::write(folder.join("times.txt"), times).expect("writes");
    let entry = &mut copied.manifest.lidar;
    "bin".clone_into(&mut entry.format);
    let half = UnitQuaternion::from_scaled_axis(Vector3::z() * PI);
    let given = entry.body_from_lidar.to_pose().expect("a pose");
    // A mirrored y axis would make the vehicle drive backwards: the operator rotates the LiDAR until it drives
    // forwards.
    let rotation = if is_mirrored { half * given.rotation * half } else { given.rotation * half };
    entry.body_from_lidar = PoseEntry::from(Pose::from_parts(given.translation, rotation));
    copied
}

#[test]
fn mirrored_points_are_found() {
    let untimed_turn = Some(SpinDirection::Counterclockwise);
    let settings = SurveySettings { untimed_turn, ..SurveySettings::default() };
    assert_eq!(doubts(&as_clouds(true).open(), &settings), ["lidar handedness"]);
}

#[test]
fn direction_of_turning_of_points_without_times_is_found() {
    let drive = as_clouds(false);
    let with = |untimed_turn| doubts(&drive.open(), &SurveySettings { untimed_turn, ..SurveySettings::default() });
    assert_eq!(with(Some(SpinDirection::Clockwise)), [""; 0]);
    assert_eq!(with(Some(SpinDirection::Counterclockwise)), ["lidar spin"]);
    assert_eq!(with(None), ["lidar spin"]);
}

#[test]
fn wrong_units_axes_and_stamps_of_the_inertial_unit_are_found() {
    let with = |change: fn(i64, [f64; 3], [f64; 3]) -> Sample| {
        Copied::from_recorded(with_turns()).with_samples(change).doubts()
    };
    assert_eq!(with(|stamp, force, rate| (stamp, force.map(|v| v / 9.806_65), rate)), ["imu units"]);
    assert_eq!(with(|stamp, force, rate| (stamp, force, rate.map(f64::to_degrees))), ["imu units"]);
    assert_eq!(with(|stamp, [x, y, z], rate| (stamp, [y, -x, z], [rate[1], -rate[0], rate[2]])), ["imu axes"]);
    assert_eq!(with(|stamp, [x, y, z], rate| (stamp, [x, -y, z], [rate[0], -rate[1], rate[2]])), ["imu axes"]);
    assert_eq!(with(|stamp, force, rate| (stamp + 80_000_000, force, rate)), ["imu delay"]);
    assert_eq!(with(|stamp, force, rate| (stamp + 3_600_000_000_000, force, rate)), ["imu clock"]);
}

#[test]
fn impossible_place_of_antenna_and_origin_are_found() {
    let mut copied = Copied::from_recorded(with_turns());
    copied.manifest.gnss.as_mut().expect("a receiver").antenna_in_body = [0.6, 20.0, 1.75];
    assert_eq!(copied.doubts(), ["gnss antenna"]);
    let mut copied = Copied::from_recorded(with_turns());
    let origin = &mut copied.manifest.gnss.as_mut().expect("a receiver").origin;
    origin.swap(0, 1);
    assert_eq!(copied.doubts(), ["gnss origin"]);
}
