//! The stage on the bench: a synthetic street with truth, and real sweeps without point times.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

#[path = "../../../shared/registration/tests/support/world.rs"]
#[allow(dead_code, reason = "the odometry's tests use more of it")]
#[allow(missing_docs, reason = "not part of the library")]
mod world;

use geometry::{Isometry3, Point3, Pose, Quaternion, Translation3, UnitQuaternion, interpolate};
use messages::{
    Gnss, GnssRow, Imu, ImuRow, NoHeader, POINT_INCIDENCE_UNKNOWN, Submap, SubmapSweep, Sweep, SweepHeader, SweepPoint,
    Trajectory,
};
use real_data::real_data;
use slam_aggregate::{Settings, SlamAggregate};
use stage::testing::{Bench, context};
use stage::{Received, Stage};
use std::path::Path;
use world::{Drive, body_from_lidar};

const STREET: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: false };

/// One sweep of the street as acquire would publish it.
struct Raw {
    stamp: i64,
    header: SweepHeader,
    rows: Vec<SweepPoint>,
}

fn raw(number: u32) -> Raw {
    let sweep = STREET.sweep(number);
    let row = |(idx, point): (usize, &registration::TimedPoint)| SweepPoint {
        x: point.position[0],
        y: point.position[1],
        z: point.position[2],
        offset_nanos: point.offset_nanos,
        azimuth: (point.offset_nanos / 2778 % 36_000) as u16,
        intensity: (idx % 251) as u8,
        ring: point.ring,
    };
    Raw {
        stamp: sweep.stamp().0,
        header: SweepHeader { duration_nanos: 100_000_000, lost_packets: 0, n_rings: 32, has_times: 1 },
        rows: sweep.points().iter().enumerate().map(row).collect(),
    }
}

fn bench(settings: &Settings) -> Bench<SlamAggregate> {
    Bench::with_stage(SlamAggregate::with_mounting(settings, body_from_lidar()))
}

/// The inertial samples and fixes of a sweep's time, and the sweep.
fn feed_with_sensors(bench: &mut Bench<SlamAggregate>, raw: &Raw) {
    let first = (raw.stamp + 9_999_999) / 10_000_000;
    let sample = |i: i64| {
        let (force, rate) = STREET.felt((first + i) as f64 * 0.01);
        ImuRow { stamp: (first + i) * 10_000_000, acceleration: force.into(), angular_rate: rate.into() }
    };
    bench.send::<Imu>(raw.stamp, NoHeader::default(), (0..10).map(sample).collect());
    let velocity = STREET.velocity(raw.stamp as f64 * 1e-9);
    let fix = GnssRow {
        stamp: raw.stamp,
        latitude_deg: 48.8,
        longitude_deg: 2.3,
        altitude_m: 100.0,
        speed_mps: velocity.xy().norm(),
        course_deg: velocity.x.atan2(velocity.y).to_degrees().rem_euclid(360.0),
        hdop: 1.0,
        satellites: 9,
        quality: 1,
        reserved: 0,
    };
    bench.send::<Gnss>(raw.stamp, NoHeader::default(), vec![fix]);
    feed(bench, raw);
}

fn feed(bench: &mut Bench<SlamAggregate>, raw: &Raw) {
    bench.send::<Sweep>(raw.stamp, raw.header, raw.rows.clone());
    bench.tick().unwrap();
}

fn run(settings: &Settings, raws: &[Raw]) -> (Bench<SlamAggregate>, Vec<Received<Submap>>) {
    let mut bench = bench(settings);
    for raw in raws {
        feed(&mut bench, raw);
    }
    bench.finish().unwrap();
    let submaps = bench.take::<Submap>();
    (bench, submaps)
}

fn world_from_submap(submap: &Received<Submap>) -> Pose {
    submap.header().world_from_submap.to_pose().unwrap()
}

fn sweeps(submap: &Received<Submap>) -> &[SubmapSweep] {
    &submap.header().sweeps[..submap.header().n_sweeps as usize]
}

fn pose(numbers: &[f32; 7]) -> Pose {
    let [x, y, z, qx, qy, qz, qw] = numbers.map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

#[test]
fn every_return_lands_where_it_was_hit() {
    let raws: Vec<Raw> = (0..24).map(raw).collect();
    let settings = Settings { submap_m: 8.0, ..Settings::default() };
    let (bench, submaps) = run(&settings, &raws);
    assert!((3..=4).contains(&submaps.len()), "{} submaps of 8 m on 23 m", submaps.len());
    let mut next_sweep = 0;
    let mut errors = Vec::new();
    for (number, submap) in submaps.iter().enumerate() {
        assert_eq!((submap.seq(), submap.stamp()), (number as u64, submap.header().stamp_begin));
        let mut next_point = 0;
        for sweep in sweeps(submap) {
            let raw = &raws[next_sweep];
            assert_eq!((sweep.stamp, sweep.seq), (raw.stamp, next_sweep as u64));
            assert_eq!(sweep.first_point, next_point);
            assert_eq!(sweep.n_points as usize, raw.rows.len(), "every return, none dropped");
            let rows = &submap.rows()[sweep.first_point as usize..][..sweep.n_points as usize];
            for (row, point) in rows.iter().zip(&raw.rows).step_by(97) {
                let seconds = (raw.stamp + i64::from(point.offset_nanos)) as f64 * 1e-9;
                let p_in_lidar = Point3::new(point.x, point.y, point.z).cast::<f64>();
                let expected = STREET.world_from_lidar(seconds) * p_in_lidar;
                let found = world_from_submap(submap) * Point3::new(row.x, row.y, row.z).cast::<f64>();
                errors.push((found - expected).norm());
            }
            next_point += sweep.n_points;
            next_sweep += 1;
        }
        assert_eq!(next_point as usize, submap.rows().len());
        let last = sweeps(submap).last().unwrap();
        assert_eq!(submap.header().stamp_end, last.stamp + i64::from(last.duration_nanos));
    }
    assert_eq!(next_sweep, raws.len());
    errors.sort_by(f64::total_cmp);
    let (median, most) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    assert!(median < 0.06 && most < 0.2, "median {median} m, 95 of 100 below {most} m, on 23 m of way");
    assert_eq!(bench.counter("sweeps_bridged"), 0);
    assert_eq!(bench.counter("points_out_of_range"), 0);
}

#[test]
fn rows_follow_from_the_sweep_table() {
    let raws: Vec<Raw> = (0..4).map(raw).collect();
    let (_, submaps) = run(&Settings::default(), &raws);
    let [submap] = &submaps[..] else { panic!("{} submaps", submaps.len()) };
    let mut known = 0;
    for (sweep, raw) in sweeps(submap).iter().zip(&raws) {
        let (begin, end) = (pose(&sweep.submap_from_lidar_begin), pose(&sweep.submap_from_lidar_end));
        let rows = &submap.rows()[sweep.first_point as usize..][..sweep.n_points as usize];
        for (row, point) in rows.iter().zip(&raw.rows) {
            assert_eq!((row.offset_nanos, row.azimuth), (point.offset_nanos, point.azimuth));
            assert_eq!((row.intensity, row.ring), (point.intensity, point.ring));
            assert_eq!(row.flags, 0, "nothing moves in this street");
            let elevation_deg = -30.67 + f64::from(point.ring) * 1.333_33;
            assert!((f64::from(row.elevation) * 0.01 - elevation_deg).abs() < 0.02);
            known += u32::from(row.incidence != POINT_INCIDENCE_UNKNOWN);
        }
        for (row, point) in rows.iter().zip(&raw.rows).step_by(53) {
            let share = f64::from(row.offset_nanos) / f64::from(sweep.duration_nanos);
            let p_in_lidar = Point3::new(point.x, point.y, point.z).cast::<f64>();
            let expected = interpolate(&begin, &end, share) * p_in_lidar;
            let found = Point3::new(row.x, row.y, row.z).cast::<f64>();
            assert!((found - expected).norm() < 0.005, "{found} {expected}");
        }
    }
    assert!(known as usize > submap.rows().len() / 2, "incidence of {known} of {}", submap.rows().len());
    let header = submap.header();
    let extreme = |axis: fn(&messages::SubmapPoint) -> f32| {
        let values = submap.rows().iter().map(axis);
        (values.clone().fold(f32::MAX, f32::min), values.fold(f32::MIN, f32::max))
    };
    assert_eq!((header.min[0], header.max[0]), extreme(|row| row.x));
    assert_eq!((header.min[2], header.max[2]), extreme(|row| row.z));
    assert_eq!(header.n_rings, 32);
    let up = world_from_submap(submap).rotation * geometry::Vector3::z();
    assert_eq!(up, geometry::Vector3::z(), "a submap is turned about z alone");
}

#[test]
fn the_trajectory_has_both_ends_of_every_sweep() {
    let raws: Vec<Raw> = (0..10).map(raw).collect();
    let mut bench = bench(&Settings::default());
    let mut poses = Vec::new();
    for (number, raw) in raws.iter().enumerate() {
        feed(&mut bench, raw);
        let rows: Vec<_> = bench.take::<Trajectory>().iter().flat_map(|message| message.rows().to_vec()).collect();
        assert_eq!(rows.len(), [0, 4, 2][number.min(2)], "tick {number}");
        poses.extend(rows);
    }
    assert!(poses[0].world_from_body.to_pose().unwrap().translation.vector.norm() < 1e-9, "begins at the origin");
    assert!(poses.windows(2).all(|pair| pair[0].stamp <= pair[1].stamp));
    for row in &poses {
        let found = row.world_from_body.to_pose().unwrap();
        let truth = STREET.world_from_body(row.stamp as f64 * 1e-9);
        let off = (found.translation.vector - truth.translation.vector).norm();
        assert!(off < 0.06, "{off} m at {} ns", row.stamp);
        assert!(found.rotation.angle_to(&truth.rotation) < 0.01);
    }
}

#[test]
fn a_submap_ends_by_way_by_time_and_by_size() {
    let raws: Vec<Raw> = (0..8).map(raw).collect();
    let lengths = |settings: Settings| {
        let (_, submaps) = run(&settings, &raws);
        submaps.iter().map(|submap| submap.header().n_sweeps).collect::<Vec<_>>()
    };
    assert_eq!(lengths(Settings::default()), [8], "closed by the end of the stream");
    assert_eq!(lengths(Settings { submap_m: 2.5, ..Settings::default() }), [3, 3, 2]);
    assert_eq!(lengths(Settings { submap_s: 0.35, ..Settings::default() }), [4, 4]);
    let two_sweeps = (raws[0].rows.len() * 5 / 2) as u32;
    assert_eq!(lengths(Settings { submap_points_max: two_sweeps, ..Settings::default() }), [2, 2, 2, 2]);
}

#[test]
fn a_sweep_larger_than_a_submap_is_an_error_that_names_the_setting() {
    let mut bench = bench(&Settings { submap_points_max: 1000, ..Settings::default() });
    feed(&mut bench, &raw(0));
    let second = raw(1);
    bench.send::<Sweep>(second.stamp, second.header, second.rows);
    let error = bench.tick().unwrap_err().to_string();
    assert!(error.contains("submap_points_max") && error.contains("1000") && error.contains("sweep 0"), "{error}");
}

#[test]
fn a_restart_anywhere_changes_no_byte() {
    let raws: Vec<Raw> = (0..9).map(raw).collect();
    let settings = Settings { submap_m: 3.5, ..Settings::default() };
    let folder = drive_folder("");
    let context = context(folder.path());
    let all = |restarts: &[usize]| {
        let mut bench = Bench::<SlamAggregate>::new(&settings, &context).unwrap();
        for (number, raw) in raws.iter().enumerate() {
            feed_with_sensors(&mut bench, raw);
            if restarts.contains(&number) {
                bench = bench.restarted(&settings, &context).unwrap();
                // A barrier may follow the next with no tick between.
                bench = bench.restarted(&settings, &context).unwrap();
            }
        }
        bench.finish().unwrap();
        let submaps: Vec<stage::Bytes> = bench.take::<Submap>().iter().map(Received::to_bytes).collect();
        let poses: Vec<stage::Bytes> = bench.take::<Trajectory>().iter().map(Received::to_bytes).collect();
        (submaps, poses)
    };
    let undisturbed = all(&[]);
    assert_eq!((undisturbed.0.len(), undisturbed.1.len()), (3, 8));
    for restarts in [&[0][..], &[1], &[4, 5], &[8]] {
        assert!(all(restarts) == undisturbed, "restarted after {restarts:?}");
    }
}

#[test]
fn what_was_leaned_on_is_told() {
    let mut raws: Vec<Raw> = (0..9).map(raw).collect();
    for raw in &mut raws[4..8] {
        raw.rows.clear();
    }
    let notes = |motion: &[&str]| {
        let motion = motion.iter().map(|name| (*name).to_owned()).collect();
        let mut bench = bench(&Settings { motion, ..Settings::default() });
        for raw in &raws {
            feed_with_sensors(&mut bench, raw);
        }
        bench.finish().unwrap();
        assert_eq!(bench.counter("sweeps_bridged"), 4);
        bench.notes().join("; ")
    };
    let (both, none) = (notes(&["imu", "gnss"]), notes(&[]));
    assert!(both.contains("held to inertial samples (4 sweeps) and the receiver's speed (4)"), "{both}");
    assert!(none.contains("held to constant motion"), "{none}");
}

#[test]
fn a_torn_state_is_refused() {
    let mut whole = bench(&Settings::default());
    feed(&mut whole, &raw(0));
    let state = whole.stage.save().unwrap().to_vec();
    let mut stage = SlamAggregate::with_mounting(&Settings::default(), body_from_lidar());
    assert!(stage.load(&state[..state.len() - 1]).is_err());
    assert!(stage.load(&state).is_ok());
}

#[test]
fn returns_from_the_vehicle_and_non_numbers_are_dropped_and_counted() {
    let mut raws: Vec<Raw> = (0..3).map(raw).collect();
    let n_points: usize = raws.iter().map(|raw| raw.rows.len()).sum();
    raws[1].rows[100].x = f32::NAN;
    raws[1].rows[5000] = SweepPoint { x: 0.3, y: 0.2, z: -0.1, ..raws[1].rows[5000] };
    raws[2].rows[7] = SweepPoint { x: 0.0, y: 0.0, z: 0.0, ..raws[2].rows[7] };
    let (bench, submaps) = run(&Settings::default(), &raws);
    assert_eq!(bench.counter("points_out_of_range"), 3);
    assert_eq!(submaps[0].rows().len(), n_points - 3);
    assert!(submaps[0].rows().iter().all(|row| row.x.is_finite()));
}

#[test]
fn thinning_keeps_the_first_point_of_each_cube() {
    let raws: Vec<Raw> = (0..2).map(raw).collect();
    let (_, submaps) = run(&Settings { thin_m: 0.5, ..Settings::default() }, &raws);
    let first = &sweeps(&submaps[0])[0];
    assert!((first.n_points as usize) < raws[0].rows.len() / 3 && first.n_points > 1000, "{}", first.n_points);
    assert_eq!(submaps[0].rows()[0].intensity, raws[0].rows[0].intensity);
}

#[test]
fn a_lone_sweep_and_an_empty_one_still_make_a_submap() {
    let (bench, submaps) = run(&Settings::default(), &[raw(0)]);
    assert_eq!((submaps.len(), bench.counter("sweeps_bridged")), (1, 1));
    let empty = Raw { rows: Vec::new(), ..raw(0) };
    let (_, submaps) = run(&Settings::default(), &[empty]);
    assert_eq!((submaps[0].rows().len(), submaps[0].header().min, submaps[0].header().max), (0, [0.0; 3], [0.0; 3]));
    let (_, submaps) = run(&Settings::default(), &[]);
    assert!(submaps.is_empty());
}

#[test]
fn the_mounting_comes_from_the_drive_and_a_bad_one_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let error = Bench::<SlamAggregate>::new(&Settings::default(), &context(empty.path())).err().unwrap().to_string();
    assert!(error.contains("drive.toml"), "{error}");
    let folder = drive_folder("rotation = [0.0, 0.0, 0.0, 2.0]");
    let error = Bench::<SlamAggregate>::new(&Settings::default(), &context(folder.path())).err().unwrap().to_string();
    assert!(error.contains("body_from_lidar") && error.contains("drive.toml"), "{error}");
}

/// A drive folder with the street's lidar, or with another `rotation` line for it.
fn drive_folder(rotation: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mounting = body_from_lidar();
    let (t, q) = (mounting.translation, mounting.rotation.coords);
    let rotation = match rotation {
        "" => format!("rotation = [{:?}, {:?}, {:?}, {:?}]", q.x, q.y, q.z, q.w),
        other => other.to_owned(),
    };
    let text = format!(
        "version = 1\nname = \"street\"\n[lidar]\nmodel = \"hdl32e\"\nformat = \"pcap\"\nfolder = \"lidar\"\n\
         [lidar.body_from_lidar]\ntranslation = [{:?}, {:?}, {:?}]\n{rotation}\n",
        t.x, t.y, t.z
    );
    // A drive has packets; this stage does not read them.
    std::fs::create_dir(folder.path().join("lidar")).unwrap();
    std::fs::write(folder.path().join("lidar/0000.pcap"), []).unwrap();
    std::fs::write(folder.path().join("drive.toml"), text).unwrap();
    folder
}

#[test]
fn real_sweeps_without_point_times() {
    let Some(folder) = real_data("kitti_raw_0048") else { return };
    let raws: Vec<Raw> = (0..22).map(|number| read_pcd(&folder, number)).collect();
    let mut bench = Bench::with_stage(SlamAggregate::with_mounting(&Settings::default(), Pose::identity()));
    for raw in &raws {
        feed(&mut bench, raw);
    }
    bench.finish().unwrap();
    let submaps = bench.take::<Submap>();
    assert_eq!(submaps.len(), 1, "17 m in 2 s");
    let origins = |raw: &Raw| raw.rows.iter().filter(|p| p.x.hypot(p.y).hypot(p.z) < 1.0).count();
    let n_dropped: usize = raws.iter().map(origins).sum();
    assert_eq!(bench.counter("points_out_of_range"), n_dropped as u64);
    assert_eq!(submaps[0].rows().len() + n_dropped, raws.iter().map(|raw| raw.rows.len()).sum::<usize>());
    let poses: Vec<_> = bench.take::<Trajectory>().iter().flat_map(|message| message.rows().to_vec()).collect();
    assert_eq!(poses.len(), 44);
    let at = |idx: usize| poses[idx].world_from_body.to_pose().unwrap().translation.vector;
    let path: f64 = (1..44).map(|idx| (at(idx) - at(idx - 1)).norm()).sum();
    // The references end at (16.90, 0.09, 0.13) after 16.9 m.
    assert!((path / 16.905 - 1.0).abs() < 0.02, "{path} m");
    assert!((at(43) - geometry::Vector3::new(16.903, 0.091, 0.125)).norm() < 0.3, "{}", at(43));
}

fn read_pcd(folder: &Path, number: usize) -> Raw {
    let bytes = std::fs::read(folder.join(format!("{number:010}.pcd"))).unwrap();
    let row = |point: &formats::cloud::CloudPoint| SweepPoint {
        x: point.x,
        y: point.y,
        z: point.z,
        intensity: (point.intensity * 255.0) as u8,
        ..SweepPoint::default()
    };
    Raw {
        stamp: number as i64 * 100_000_000,
        header: SweepHeader { duration_nanos: 100_000_000, lost_packets: 0, n_rings: 0, has_times: 0 },
        rows: formats::pcd::points_from_pcd(&bytes).unwrap().iter().map(row).collect(),
    }
}
