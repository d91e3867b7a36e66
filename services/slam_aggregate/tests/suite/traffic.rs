//! Simulated drives with the LiDAR alone, from rest: in a queue that starts with the vehicle, without one, and on a
//! bare road.

use drive::Drive;
use geometry::Pose;
use messages::{SweepHeader, SweepPoint, SweepTopic, TrajectoryTopic};
use simulation::{DriveSettings, DriveSpec, Town, Traffic, write_drive};
use slam_aggregate::{Settings, SlamAggregate};
use stage::testing::Bench;

/// Duration of a drive. A vehicle at rest needs two seconds to get ahead of a queue, or not.
const SECONDS: f64 = 6.0;

/// The stage after a drive in a town, and the lengths of its track and of the true track, m.
fn driven(traffic: Traffic) -> (Bench<SlamAggregate>, [f64; 2]) {
    let rig = String::from("nuscenes");
    driven_as(&DriveSettings { seed: 811, seconds: SECONDS, rig, traffic, ..DriveSettings::default() })
}

fn driven_as(settings: &DriveSettings) -> (Bench<SlamAggregate>, [f64; 2]) {
    let spec = DriveSpec { cameras: false, mosaics: false, ..settings.spec().unwrap() };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive");
    write_drive(&spec, &path, &mut |_| {}).unwrap();
    let drive = Drive::open(&path).unwrap();
    let settings = Settings { motion: Vec::new(), correct: Vec::new(), ..Settings::default() };
    let mut bench = Bench::with_stage(SlamAggregate::with_mounting(&settings, drive.rig().body_from_lidar));
    let mut sweeps = drive.sweeps().unwrap();
    let mut rows = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|piece| rows.extend(piece.iter().map(row))).unwrap() {
        let header = SweepHeader { duration_nanos: 100_000_000, lost_packets: 0, n_rings: 32, has_times: 1, lidar: 0 };
        if sweep.turn > 0.95 {
            bench.send::<SweepTopic>(sweep.stamp.0, header, std::mem::take(&mut rows));
            bench.tick().unwrap();
        }
        rows.clear();
    }
    bench.finish().unwrap();
    let found: Vec<Pose> = bench
        .take::<TrajectoryTopic>()
        .iter()
        .flat_map(|message| message.rows().iter().map(|row| row.odom_from_body.to_pose().unwrap()).collect::<Vec<_>>())
        .collect();
    let truth = drive.true_trajectory().unwrap().unwrap();
    let way = |first: &Pose, last: &Pose| (last.translation.vector - first.translation.vector).norm();
    let [first, .., last] = truth.poses() else { panic!("the truth is a path") };
    (bench, [way(&found[0], &found[found.len() - 1]), way(&first.1, &last.1)])
}

fn row(point: &lidar::SweepPoint) -> SweepPoint {
    SweepPoint {
        x: point.x,
        y: point.y,
        z: point.z,
        offset_nanos: point.offset_nanos,
        ring: point.ring,
        ..SweepPoint::default()
    }
}

#[test]
fn queue_that_is_taken_for_the_world_is_a_doubt() {
    let (bench, [found_m, true_m]) = driven(Traffic::Dense);
    assert!(found_m < 0.5 * true_m, "{found_m} m of {true_m} m: with a better odometry this drive needs no doubt");
    let seconds = bench.doubt("motion_contested").unwrap();
    assert!((1.0..=SECONDS).contains(&seconds), "{seconds} s");
}

#[test]
fn drive_in_sparse_traffic_is_no_doubt() {
    let (bench, [found_m, true_m]) = driven(Traffic::Normal);
    assert!((found_m - true_m).abs() < 0.1, "{found_m} m of {true_m} m");
    assert_eq!([bench.doubt("motion_contested"), bench.doubt("path_lost")], [None; 2]);
}

/// Only the road is near, and the LiDAR, tilted as on the L3D2 vehicle, does not cover the area ahead: the vehicle
/// seems to stand.
#[test]
fn way_that_is_lost_on_a_bare_road_is_a_doubt() {
    let town = Town::Field;
    let (bench, [found_m, true_m]) =
        driven_as(&DriveSettings { town, seed: 823, seconds: SECONDS, ..DriveSettings::default() });
    assert!(found_m < 0.5 * true_m, "{found_m} m of {true_m} m: with a better odometry this drive needs no doubt");
    let lost_m = bench.doubt("path_lost").unwrap();
    assert!(lost_m > true_m - found_m, "stated {lost_m} m, lost {} m", true_m - found_m);
}
