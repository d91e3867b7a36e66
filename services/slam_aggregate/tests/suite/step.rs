//! The stage tick by tick: a synthetic street with ground truth, and real sweeps without point times.

use crate::gnss_row::gnss_row;
use crate::street::{RawSweep, STREET, imu_row, raw, send};
use crate::world::body_from_lidar;
use geometry::{Geodetic, Isometry3, Point3, Pose, Quaternion, Translation3, UnitQuaternion, interpolate};
use messages::{
    GnssRow, GnssTopic, ImuTopic, NoHeader, POINT_INCIDENCE_UNKNOWN, SubmapSweep, SubmapTopic, SweepHeader, SweepPoint,
    SweepTopic, TrajectoryTopic,
};
use slam_aggregate::{MotionSensor, OdometryAlgorithm, Settings, SlamAggregate};
use stage::testing::{Bench, context};
use stage::{Received, Stage, Word};
use std::path::Path;

fn bench(settings: &Settings) -> Bench<SlamAggregate> {
    Bench::with_stage(SlamAggregate::with_mounting(settings, body_from_lidar()))
}

/// The inertial samples and fixes of a sweep's time, and the sweep.
fn feed_with_sensors(bench: &mut Bench<SlamAggregate>, raw: &RawSweep) {
    let first = (raw.stamp + 9_999_999) / 10_000_000;
    let sample = |i: i64| imu_row((first + i) * 10_000_000);
    bench.send::<ImuTopic>(raw.stamp, NoHeader::default(), (0..10).map(sample).collect());
    let second = raw.stamp as f64 * 1e-9;
    let fix = gnss_row(second, &Geodetic::new(48.8, 2.3, 100.0).unwrap(), &STREET.velocity(second));
    let fix = GnssRow { satellites: 9, quality: 1, ..fix };
    bench.send::<GnssTopic>(raw.stamp, NoHeader::default(), vec![fix]);
    feed(bench, raw);
}

fn feed(bench: &mut Bench<SlamAggregate>, raw: &RawSweep) {
    send(bench, raw);
    bench.tick().unwrap();
}

fn run(settings: &Settings, raws: &[RawSweep]) -> (Bench<SlamAggregate>, Vec<Received<SubmapTopic>>) {
    let mut bench = bench(settings);
    for raw in raws {
        feed(&mut bench, raw);
    }
    bench.finish().unwrap();
    let submaps = bench.take::<SubmapTopic>();
    (bench, submaps)
}

fn odom_from_submap(submap: &Received<SubmapTopic>) -> Pose {
    submap.header().odom_from_submap.to_pose().unwrap()
}

fn sweeps(submap: &Received<SubmapTopic>) -> &[SubmapSweep] {
    &submap.header().sweeps[..submap.header().n_sweeps as usize]
}

fn pose(numbers: &[f32; 7]) -> Pose {
    let [x, y, z, qx, qy, qz, qw] = numbers.map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

#[test]
fn every_return_is_placed_at_its_true_position() {
    let raws: Vec<RawSweep> = (0..24).map(raw).collect();
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
                let found = odom_from_submap(submap) * Point3::new(row.x, row.y, row.z).cast::<f64>();
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
    let median = errors[errors.len() / 2];
    let most = errors[errors.len() * 95 / 100];
    assert!(median < 0.06 && most < 0.2, "median {median} m, 95 % below {most} m, on a path of 23 m");
    assert_eq!(bench.counter("sweeps_bridged"), 0);
    assert_eq!(bench.counter("points_out_of_range"), 0);
}

#[test]
fn submap_rows_follow_from_the_sweep_table() {
    let raws: Vec<RawSweep> = (0..4).map(raw).collect();
    let (_, submaps) = run(&Settings::default(), &raws);
    let [submap] = &submaps[..] else { panic!("{} submaps", submaps.len()) };
    let mut known = 0;
    for (sweep, raw) in sweeps(submap).iter().zip(&raws) {
        let begin = pose(&sweep.submap_from_lidar_begin);
        let end = pose(&sweep.submap_from_lidar_end);
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
    let up = odom_from_submap(submap).rotation * geometry::Vector3::z();
    assert_eq!(up, geometry::Vector3::z(), "a submap is rotated about z only");
}

#[test]
fn trajectory_has_both_ends_of_every_sweep() {
    let raws: Vec<RawSweep> = (0..10).map(raw).collect();
    let mut bench = bench(&Settings::default());
    let mut poses = Vec::new();
    for (number, raw) in raws.iter().enumerate() {
        feed(&mut bench, raw);
        let rows: Vec<_> = bench.take::<TrajectoryTopic>().iter().flat_map(|message| message.rows().to_vec()).collect();
        assert_eq!(rows.len(), [0, 4, 2][number.min(2)], "tick {number}");
        poses.extend(rows);
    }
    assert!(poses[0].odom_from_body.to_pose().unwrap().translation.vector.norm() < 1e-9, "begins at the origin");
    assert!(poses.windows(2).all(|pair| pair[0].stamp <= pair[1].stamp));
    for row in &poses {
        let found = row.odom_from_body.to_pose().unwrap();
        let truth = STREET.world_from_body(row.stamp as f64 * 1e-9);
        let off = (found.translation.vector - truth.translation.vector).norm();
        assert!(off < 0.06, "{off} m at {} ns", row.stamp);
        assert!(found.rotation.angle_to(&truth.rotation) < 0.01);
    }
}

#[test]
fn submap_ends_by_path_by_time_and_by_size() {
    let raws: Vec<RawSweep> = (0..8).map(raw).collect();
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
fn sweep_larger_than_a_submap_is_an_error_naming_the_setting() {
    let mut bench = bench(&Settings { submap_points_max: 1000, ..Settings::default() });
    feed(&mut bench, &raw(0));
    let second = raw(1);
    bench.send::<SweepTopic>(second.stamp, second.header, second.rows);
    let error = bench.tick().unwrap_err().to_string();
    assert!(error.contains("submap_points_max") && error.contains("1000") && error.contains("sweep 0"), "{error}");
}

/// Bytes of submaps and poses, with restarts from the saved state after some of the sweeps.
fn bytes_with_restarts(
    settings: &Settings,
    raws: &[RawSweep],
    restarts: &[usize],
) -> (Vec<stage::Bytes>, Vec<stage::Bytes>) {
    let folder = drive_folder("");
    let context = context(folder.path());
    let mut bench = Bench::<SlamAggregate>::new(settings, &context).unwrap();
    for (number, raw) in raws.iter().enumerate() {
        feed_with_sensors(&mut bench, raw);
        if restarts.contains(&number) {
            bench = bench.restarted(settings, &context).unwrap();
            // Two barriers may follow each other without a tick in between.
            bench = bench.restarted(settings, &context).unwrap();
        }
    }
    bench.finish().unwrap();
    let submaps = bench.take::<SubmapTopic>().iter().map(|message| stage::Bytes(message.to_bytes())).collect();
    let poses = bench.take::<TrajectoryTopic>().iter().map(|message| stage::Bytes(message.to_bytes())).collect();
    (submaps, poses)
}

#[test]
fn submaps_and_poses_after_restarts_have_the_same_bytes() {
    let raws: Vec<RawSweep> = (0..9).map(raw).collect();
    let settings = Settings { submap_m: 3.5, ..Settings::default() };
    let uninterrupted = bytes_with_restarts(&settings, &raws, &[]);
    assert_eq!((uninterrupted.0.len(), uninterrupted.1.len()), (3, 8));
    for restarts in [&[0][..], &[1], &[4, 5], &[8]] {
        assert!(bytes_with_restarts(&settings, &raws, restarts) == uninterrupted, "restarted after {restarts:?}");
    }
}

#[test]
fn imls_submaps_and_poses_after_restarts_have_the_same_bytes() {
    let raws: Vec<RawSweep> = (0..9).map(raw).collect();
    let settings = Settings { submap_m: 3.5, odometry: OdometryAlgorithm::Imls, imls_sweeps: 4, ..Settings::default() };
    let uninterrupted = bytes_with_restarts(&settings, &raws, &[]);
    assert_eq!((uninterrupted.0.len(), uninterrupted.1.len()), (3, 8));
    let default = bytes_with_restarts(&Settings { submap_m: 3.5, ..Settings::default() }, &raws, &[]);
    assert!(uninterrupted.1 != default.1, "another algorithm gives other poses");
    for restarts in [&[0][..], &[1], &[4, 5]] {
        assert!(bytes_with_restarts(&settings, &raws, restarts) == uninterrupted, "restarted after {restarts:?}");
    }
}

#[test]
fn imls_settings_are_checked_by_name() {
    let rule = |key: &str| {
        let field = <Settings as stage::Settings>::fields().into_iter().find(|field| field.key == key);
        field.map(|field| (field.default, field.rule)).unwrap()
    };
    let expected = |default: &str, rule: &str| (default.to_owned(), rule.to_owned());
    assert_eq!(rule("odometry"), expected("\"scan_to_map\"", "must be one of scan_to_map, imls"));
    assert_eq!(rule("imls_samples"), expected("100", "must be between 10 and 10000"));
    assert_eq!(rule("imls_h_m"), expected("0.06", "must be between 0.02 and 0.5"));
    assert_eq!(rule("imls_radius_m"), expected("0.2", "must be between 0.05 and 0.5"));
    assert_eq!(rule("imls_rounds"), expected("20", "must be between 1 and 200"));
    assert_eq!(rule("imls_sweeps"), expected("100", "must be between 1 and 1000"));
    let folder = drive_folder("");
    assert_eq!(SlamAggregate::check(&Settings::default(), &context(folder.path())), []);
    let wide = Settings { imls_h_m: 0.3, ..Settings::default() };
    let problems = SlamAggregate::check(&wide, &context(folder.path()));
    assert!(problems.len() == 1 && problems[0].key == "imls_h_m", "{problems:?}");
    assert!(problems[0].text.contains("imls_radius_m"), "{problems:?}");
}

#[test]
fn state_saved_with_another_odometry_is_refused() {
    let folder = drive_folder("");
    let context = context(folder.path());
    let mut bench = Bench::<SlamAggregate>::new(&Settings::default(), &context).unwrap();
    feed_with_sensors(&mut bench, &raw(0));
    let imls = Settings { odometry: OdometryAlgorithm::Imls, ..Settings::default() };
    let error = bench.restarted(&imls, &context).err().unwrap().to_string();
    assert!(error.contains("another odometry"), "{error}");
}

#[test]
fn report_on_bridged_sweeps_names_the_predicting_sensors() {
    let mut raws: Vec<RawSweep> = (0..9).map(raw).collect();
    for raw in &mut raws[4..8] {
        raw.rows.clear();
    }
    let notes = |motion: &[MotionSensor]| {
        let mut bench = bench(&Settings { motion: motion.to_vec(), ..Settings::default() });
        for raw in &raws {
            feed_with_sensors(&mut bench, raw);
        }
        bench.finish().unwrap();
        assert_eq!(bench.counter("sweeps_bridged"), 4);
        bench.notes().join("; ")
    };
    let both = notes(MotionSensor::ALL);
    let none = notes(&[]);
    // The sweep after the gap has few surfaces of the map in view: its weak directions follow the sensors too.
    assert!(both.contains("predicted by inertial samples (5 sweeps) and GNSS velocities (5)"), "{both}");
    assert!(none.contains("predicted by constant motion"), "{none}");
}

/// Every 60th return of a sweep: too few to match.
fn sparse(number: u32) -> RawSweep {
    let mut raw = raw(number);
    raw.rows = raw.rows.iter().step_by(60).copied().collect();
    raw
}

#[test]
fn drive_whose_sweeps_never_match_is_a_doubt() {
    let raws: Vec<RawSweep> = (0..12).map(sparse).collect();
    let doubts = |settings: &Settings, raws: &[RawSweep]| {
        let (bench, _) = run(settings, raws);
        ["no_sweep_matched", "path_unmatched", "path_lost"].map(|name| bench.doubt(name))
    };
    for algorithm in OdometryAlgorithm::ALL {
        let settings = Settings { odometry: *algorithm, max_unmatched_s: 100.0, ..Settings::default() };
        assert_eq!(doubts(&settings, &raws), [Some(12.0), None, None], "whatever the limit and the deviation");
    }
    let dense: Vec<RawSweep> = (0..12).map(raw).collect();
    assert_eq!(doubts(&Settings::default(), &dense), [None; 3]);
    assert_eq!(doubts(&Settings::default(), &raws[..1]), [None; 3], "one sweep has nothing to match");
}

#[test]
fn stretch_without_matches_is_a_doubt_also_after_a_restart() {
    let raws: Vec<RawSweep> =
        (0..20).map(|number| if (8..14).contains(&number) { sparse(number) } else { raw(number) }).collect();
    let folder = drive_folder("");
    let context = context(folder.path());
    let mut bench = Bench::<SlamAggregate>::new(&Settings::default(), &context).unwrap();
    for (number, raw) in raws.iter().enumerate() {
        feed(&mut bench, raw);
        if number == 11 {
            bench = bench.restarted(&Settings::default(), &context).unwrap();
        }
    }
    bench.finish().unwrap();
    let seconds = bench.doubt("path_unmatched").unwrap();
    assert!((0.5..1.2).contains(&seconds), "{seconds} s");
    assert_eq!(bench.doubt("no_sweep_matched"), None);
}

#[test]
fn truncated_state_is_rejected() {
    let mut whole = bench(&Settings::default());
    feed(&mut whole, &raw(0));
    let state = whole.stage.save().unwrap().to_vec();
    let mut stage = SlamAggregate::with_mounting(&Settings::default(), body_from_lidar());
    assert!(stage.load(&state[..state.len() - 1]).is_err());
    stage.load(&state).expect("the whole state");
    assert_eq!(stage.save().unwrap().to_vec(), state, "the state that was read");
}

#[test]
fn near_and_non_finite_returns_are_dropped_and_counted() {
    let mut raws: Vec<RawSweep> = (0..3).map(raw).collect();
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
fn thinning_keeps_the_first_point_of_each_voxel() {
    let raws: Vec<RawSweep> = (0..2).map(raw).collect();
    let (_, submaps) = run(&Settings { thin_m: 0.5, ..Settings::default() }, &raws);
    let first = &sweeps(&submaps[0])[0];
    assert!((first.n_points as usize) < raws[0].rows.len() / 3 && first.n_points > 1000, "{}", first.n_points);
    assert_eq!(submaps[0].rows()[0].intensity, raws[0].rows[0].intensity);
}

#[test]
fn single_and_empty_sweeps_make_a_submap() {
    let (bench, submaps) = run(&Settings::default(), &[raw(0)]);
    assert_eq!((submaps.len(), bench.counter("sweeps_bridged")), (1, 1));
    let empty = RawSweep { rows: Vec::new(), ..raw(0) };
    let (_, submaps) = run(&Settings::default(), &[empty]);
    assert_eq!((submaps[0].rows().len(), submaps[0].header().min, submaps[0].header().max), (0, [0.0; 3], [0.0; 3]));
    let (_, submaps) = run(&Settings::default(), &[]);
    assert!(submaps.is_empty());
}

#[test]
fn invalid_mounting_of_a_drive_is_named() {
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
    let t = mounting.translation;
    let q = mounting.rotation.coords;
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

#[real_data::test("kitti_raw_0048")]
fn real_sweeps_without_point_times_follow_the_references() {
    let folder = real_data::path("kitti_raw_0048");
    let raws: Vec<RawSweep> = (0..22).map(|number| read_pcd(&folder, number)).collect();
    let mut bench = Bench::with_stage(SlamAggregate::with_mounting(&Settings::default(), Pose::identity()));
    for raw in &raws {
        feed(&mut bench, raw);
    }
    bench.finish().unwrap();
    let submaps = bench.take::<SubmapTopic>();
    assert_eq!(submaps.len(), 1, "17 m in 2 s");
    let origins = |raw: &RawSweep| raw.rows.iter().filter(|p| p.x.hypot(p.y).hypot(p.z) < 1.0).count();
    let n_dropped: usize = raws.iter().map(origins).sum();
    assert_eq!(bench.counter("points_out_of_range"), n_dropped as u64);
    assert_eq!(submaps[0].rows().len() + n_dropped, raws.iter().map(|raw| raw.rows.len()).sum::<usize>());
    let poses: Vec<_> = bench.take::<TrajectoryTopic>().iter().flat_map(|message| message.rows().to_vec()).collect();
    assert_eq!(poses.len(), 44);
    // The direction of rotation is found after 15 sweeps. The references treat all as rigid: their poses are at the
    // middle.
    let end_of = |idx: usize| poses[idx].odom_from_body.to_pose().unwrap().translation.vector;
    let at = |number: usize| (end_of(2 * number) + end_of(2 * number + 1)) / 2.0;
    let path: f64 = (1..22).map(|number| (at(number) - at(number - 1)).norm()).sum();
    // The references end at (16.90, 0.09, 0.13) after 16.9 m.
    assert!((path / 16.905 - 1.0).abs() < 0.02, "{path} m");
    assert!((at(21) - geometry::Vector3::new(16.903, 0.091, 0.125)).norm() < 0.3, "{}", at(21));
}

fn read_pcd(folder: &Path, number: usize) -> RawSweep {
    let bytes = std::fs::read(folder.join(format!("{number:010}.pcd"))).unwrap();
    let row = |point: &formats::cloud::CloudPoint| SweepPoint {
        x: point.x,
        y: point.y,
        z: point.z,
        intensity: (point.intensity * 255.0) as u8,
        ..SweepPoint::default()
    };
    RawSweep {
        stamp: number as i64 * 100_000_000,
        header: SweepHeader { duration_nanos: 100_000_000, lost_packets: 0, n_rings: 0, has_times: 0, lidar: 0 },
        rows: formats::pcd::points_from_pcd(&bytes).unwrap().iter().map(row).collect(),
    }
}

/// Regression: twenty million points passed the check, and no message could hold them.
#[test]
fn largest_submap_fits_a_message() {
    use messages::Message;
    let rule = <Settings as stage::Settings>::fields().into_iter().find(|field| field.key == "submap_points_max");
    let limit = messages::SubmapTopic::MAX_ROWS;
    assert_eq!(rule.map(|field| field.rule), Some(format!("must be between 1000 and {limit}")));
}
