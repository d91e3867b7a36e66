//! Sweeps placed by a given path: the truth of a street, a profile scanner, recorded sweeps, restarts, refusals.

use crate::placement::drive_folder;
use crate::street::{RawSweep, STREET, raw, send};
use geometry::{Isometry3, Point3, Pose, Stamp, Trajectory, Vector3};
use messages::{FRAME_LOCAL, PlacementTopic, SubmapTopic, SweepHeader, TrajectoryTopic};
use slam_aggregate::{PathSource, Settings, SlamAggregate};
use stage::testing::{Bench, context};
use stage::{Context, Mode, Received, Stage};

const N_SWEEPS: u32 = 24;

fn settings() -> Settings {
    Settings { submap_m: 8.0, path: PathSource::Given, ..Settings::default() }
}

/// The true path of the body, 100 poses a second.
fn true_path(end_s: f64) -> Trajectory {
    let mut path = Trajectory::default();
    for number in 0..=(end_s * 100.0) as i64 {
        path.push(Stamp(number * 10_000_000), STREET.world_from_body(number as f64 * 0.01));
    }
    path
}

/// A drive folder of the street that names this path.
fn folder_with(path: &Trajectory, keys: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    drive_folder(folder.path());
    let text = formats::trajectory::tum_from_trajectory(path);
    std::fs::write(folder.path().join("path.txt"), text).unwrap();
    let toml = folder.path().join("drive.toml");
    let entry = format!("[trajectory]\nfile = \"path.txt\"\nformat = \"tum\"\n{keys}\n");
    std::fs::write(&toml, std::fs::read_to_string(&toml).unwrap() + &entry).unwrap();
    folder
}

fn bench(context: &Context) -> Bench<SlamAggregate> {
    Bench::<SlamAggregate>::new(&settings(), context).unwrap()
}

fn feed(bench: &mut Bench<SlamAggregate>, raw: &RawSweep) {
    send(bench, raw);
    bench.tick().unwrap();
}

/// Largest distance of the points of all submaps from their true places, m.
fn largest_error_m(submaps: &[Received<SubmapTopic>], raws: &[RawSweep]) -> f64 {
    let mut largest: f64 = 0.0;
    let mut n = 0;
    for submap in submaps {
        let odom_from_submap: Pose = submap.header().odom_from_submap.to_pose().unwrap();
        for sweep in &submap.header().sweeps[..submap.header().n_sweeps as usize] {
            let raw = raws.iter().find(|raw| raw.stamp == sweep.stamp).unwrap();
            let rows = &submap.rows()[sweep.first_point as usize..][..sweep.n_points as usize];
            assert_eq!(rows.len(), raw.rows.len());
            for (row, point) in rows.iter().zip(&raw.rows) {
                let seconds = (raw.stamp + i64::from(point.offset_nanos)) as f64 * 1e-9;
                let p_in_lidar = Point3::new(point.x, point.y, point.z).cast::<f64>();
                let expected = STREET.world_from_lidar(seconds) * p_in_lidar;
                let found = odom_from_submap * Point3::new(row.x, row.y, row.z).cast::<f64>();
                largest = largest.max((found - expected).norm());
                n += 1;
            }
        }
    }
    assert_eq!(n, raws.iter().map(|raw| raw.rows.len()).sum::<usize>(), "every return, none dropped");
    largest
}

#[test]
fn points_are_within_a_centimetre_of_the_truth_with_all_rings_and_with_one() {
    let folder = folder_with(&true_path(4.0), "");
    let context = context(folder.path());
    let all: Vec<RawSweep> = (0..N_SWEEPS).map(raw).collect();
    // A profile scanner sees too little for odometry.
    let profiles: Vec<RawSweep> = (0..N_SWEEPS)
        .map(|number| {
            let mut raw = raw(number);
            raw.rows.retain(|row| row.ring == 12);
            raw
        })
        .collect();
    for raws in [&all, &profiles] {
        let mut bench = bench(&context);
        for raw in raws {
            feed(&mut bench, raw);
        }
        bench.finish().unwrap();
        let submaps = bench.take::<SubmapTopic>();
        assert!((3..=4).contains(&submaps.len()), "{} submaps of 8 m on 23 m", submaps.len());
        let error_m = largest_error_m(&submaps, raws);
        assert!(error_m < 0.01, "{error_m} m");
        assert_eq!(bench.counter("sweeps_bridged"), 0);
        let placement = bench.take::<PlacementTopic>().remove(0);
        assert_eq!(placement.header().frame, FRAME_LOCAL);
        assert_eq!(placement.rows().len(), submaps.len());
        for (row, submap) in placement.rows().iter().zip(&submaps) {
            assert_eq!(row.world_from_submap, submap.header().odom_from_submap);
            assert!(row.sigma_m.iter().all(|sigma| (*sigma - 0.1).abs() < 1e-6), "{row:?}");
        }
        let notes = bench.notes().join("\n");
        assert!(
            notes.contains("it does not state all standard deviations; 0.1 m and 0.1 degrees are assumed"),
            "{notes}"
        );
    }
}

#[test]
fn path_on_the_earth_places_the_result_there_with_its_deviations() {
    let keys = "origin = [48.85, 2.35, 60.0]\ndeviation_m = [0.01, 0.02, 0.03]\ndeviation_deg = [0.01, 0.01, 0.05]";
    let folder = folder_with(&true_path(2.0), keys);
    let mut bench = bench(&context(folder.path()));
    (0..8).for_each(|number| feed(&mut bench, &raw(number)));
    bench.finish().unwrap();
    let placement = bench.take::<PlacementTopic>().remove(0);
    let header = placement.header();
    assert_eq!((header.latitude_deg, header.longitude_deg, header.altitude_m), (48.85, 2.35, 60.0));
    // The street leads to the east.
    let row = &placement.rows()[0];
    assert!((row.sigma_m[0] - 0.01).abs() < 1e-3 && (row.sigma_m[2] - 0.03).abs() < 1e-6, "{row:?}");
    assert!((f64::from(row.sigma_rad[2]) - 0.05_f64.to_radians()).abs() < 1e-7, "{row:?}");
    assert!(!bench.notes().iter().any(|note| note.contains("standard deviations; 0.1 m")));
}

#[test]
fn restarts_give_the_same_bytes_and_another_path_is_refused() {
    let folder = folder_with(&true_path(4.0), "");
    let context = context(folder.path());
    let run = |restarts: &[u32]| {
        let mut bench = bench(&context);
        let mut bytes = Vec::new();
        for number in 0..20 {
            feed(&mut bench, &raw(number));
            bytes.extend(bench.take::<SubmapTopic>().iter().flat_map(Received::to_bytes));
            bytes.extend(bench.take::<TrajectoryTopic>().iter().flat_map(Received::to_bytes));
            if restarts.contains(&number) {
                bench = bench.restarted(&settings(), &context).unwrap();
            }
        }
        bench.finish().unwrap();
        bytes.extend(bench.take::<SubmapTopic>().iter().flat_map(Received::to_bytes));
        bytes.extend(bench.take::<PlacementTopic>().iter().flat_map(Received::to_bytes));
        bytes
    };
    let uninterrupted = run(&[]);
    assert!(run(&[0, 7, 15]) == uninterrupted);

    let mut stopped = bench(&context);
    feed(&mut stopped, &raw(0));
    let mut moved = Trajectory::default();
    for (stamp, pose) in true_path(4.0).poses() {
        moved.push(*stamp, Isometry3::translation(0.0, 0.0, 1e-6) * pose);
    }
    std::fs::write(folder.path().join("path.txt"), formats::trajectory::tum_from_trajectory(&moved)).unwrap();
    let error = stopped.restarted(&settings(), &context).err().unwrap().to_string();
    assert!(error.contains("[trajectory] has changed"), "{error}");
}

#[test]
fn one_stated_deviation_is_used_and_another_one_refuses_a_restart() {
    let folder = folder_with(&true_path(4.0), "deviation_m = [0.01, 0.02, 0.03]");
    let context = context(folder.path());
    let mut stopped = bench(&context);
    feed(&mut stopped, &raw(0));
    let manifest = folder.path().join("drive.toml");
    let changed = std::fs::read_to_string(&manifest).unwrap().replace("0.03]", "0.04]");
    std::fs::write(&manifest, changed).unwrap();
    let error = stopped.restarted(&settings(), &context).err().unwrap().to_string();
    assert!(error.contains("[trajectory] has changed"), "{error}");

    let mut bench = bench(&context);
    (0..8).for_each(|number| feed(&mut bench, &raw(number)));
    bench.finish().unwrap();
    let row = bench.take::<PlacementTopic>().remove(0).rows()[0];
    assert!((row.sigma_m[2] - 0.04).abs() < 1e-6, "{row:?}");
    assert!((f64::from(row.sigma_rad[2]) - 0.1_f64.to_radians()).abs() < 1e-7, "{row:?}");
}

#[test]
fn path_that_does_not_cover_a_sweep_stops_the_run_with_its_time() {
    let folder = folder_with(&true_path(1.05), "");
    let mut bench = bench(&context(folder.path()));
    (0..10).for_each(|number| feed(&mut bench, &raw(number)));
    send(&mut bench, &raw(10));
    let error = bench.tick().expect_err("is not covered").to_string();
    assert!(error.contains("sweep 10") && error.contains("not 1970-01-01 00:00:00.999"), "{error}");
}

#[test]
fn paths_that_cannot_be_used_are_problems_before_the_start() {
    let problems = |context: &Context| {
        let found = SlamAggregate::check(&settings(), context);
        found.into_iter().map(|problem| problem.text).collect::<Vec<_>>().join("\n")
    };
    let folder = folder_with(&true_path(4.0), "");
    let offline = context(folder.path());
    assert_eq!(problems(&offline), "");
    let live = problems(&Context { mode: Mode::Live, ..offline });
    assert!(live.contains("exists only after the drive"), "{live}");
    let without = tempfile::tempdir().unwrap();
    drive_folder(without.path());
    let without = problems(&context(without.path()));
    assert!(without.contains("needs [trajectory]"), "{without}");
    // The street leads to the east: a heading that is turned by a right angle contradicts it.
    let mut turned = Trajectory::default();
    for (stamp, pose) in true_path(20.0).poses() {
        turned.push(*stamp, pose * Isometry3::rotation(Vector3::z() * 1.57));
    }
    let folder = folder_with(&turned, "");
    let turned = problems(&context(folder.path()));
    assert!(turned.contains("the heading differs from the direction of travel by 90 deg"), "{turned}");
    let accepting = Settings { check_path: false, ..settings() };
    assert!(SlamAggregate::check(&accepting, &context(folder.path())).is_empty());
}

/// The true path with 5 cm and 0.05 degrees of noise at each pose, and 0.3 m off from 3 to 5 s.
fn disturbed_path(end_s: f64) -> Trajectory {
    let mut random = random::Random::new(5);
    let mut path = Trajectory::default();
    for (stamp, pose) in true_path(end_s).poses() {
        let mut noise = |sigma: f64| Vector3::from_fn(|_, _| f64::from(random.gauss())) * sigma;
        let step = (3_000_000_000..5_000_000_000).contains(&stamp.0);
        let off = noise(0.05) + if step { Vector3::new(0.18, -0.24, 0.0) } else { Vector3::zeros() };
        let turn = geometry::UnitQuaternion::from_scaled_axis(noise(0.05_f64.to_radians()));
        let position = geometry::Translation3::from(pose.translation.vector + off);
        path.push(*stamp, Isometry3::from_parts(position, turn * pose.rotation));
    }
    path
}

#[test]
fn refined_path_is_better_than_the_given_one_and_survives_restarts() {
    let keys = "deviation_m = [0.05, 0.05, 0.05]\ndeviation_deg = [0.05, 0.05, 0.05]";
    let folder = folder_with(&disturbed_path(9.0), keys);
    let context = context(folder.path());
    let settings = Settings { path: PathSource::Refined, ..settings() };
    let run = |restarts: &[u32]| {
        let mut bench = Bench::<SlamAggregate>::new(&settings, &context).unwrap();
        for number in 0..80 {
            feed(&mut bench, &raw(number));
            if restarts.contains(&number) {
                bench = bench.restarted(&settings, &context).unwrap();
            }
        }
        bench.finish().unwrap();
        (bench.take::<PlacementTopic>().remove(0), bench.notes().join("\n"))
    };
    let (placement, notes) = run(&[]);
    assert!(notes.contains("2 steps of the path, the largest 0.3"), "{notes}");
    let mut squares = [0.0; 2];
    for row in placement.rows() {
        let pose: Pose = row.world_from_submap.to_pose().unwrap();
        let off = pose.translation.vector - STREET.world_from_body(row.stamp as f64 * 1e-9).translation.vector;
        squares = [squares[0] + off.xy().norm_squared(), squares[1] + off.z * off.z];
    }
    let [across_m, up_m] = squares.map(|sum| (sum / placement.rows().len() as f64).sqrt());
    println!("{} submaps: {across_m:.4} m horizontally, {up_m:.4} m up", placement.rows().len());
    assert!(across_m < 0.02 && up_m < 0.02, "{across_m} m, {up_m} m");
    assert!(run(&[3, 37]).0.to_bytes() == placement.to_bytes());
}

#[test]
fn path_is_only_compared_by_default() {
    let folder = folder_with(&true_path(4.0), "");
    let plain = tempfile::tempdir().unwrap();
    drive_folder(plain.path());
    let settings = Settings { path: PathSource::Odometry, ..settings() };
    let run = |folder: &std::path::Path| {
        let mut bench = Bench::<SlamAggregate>::new(&settings, &context(folder)).unwrap();
        (0..N_SWEEPS).for_each(|number| feed(&mut bench, &raw(number)));
        bench.finish().unwrap();
        let notes = bench.notes().join("\n");
        (bench.take::<PlacementTopic>().remove(0).to_bytes(), notes)
    };
    let (with, notes) = run(folder.path());
    assert!(notes.contains("the given path differs from the result by 0.0"), "{notes}");
    assert!(notes.contains("after alignment"), "{notes}");
    assert!(with == run(plain.path()).0, "the path does not change the result");
}

/// Five sweeps of a LiDAR with 64 rings, and the poses of the LiDAR by a `NovAtel` solution at 10 Hz. The file names are in UTC+8, and
/// name the ends of the sweeps; the vehicle stands, so the poses differ by 0.1 mm. The first sweep is before the first pose.
#[real_data::test(
    "trajectories/novatel_ins_csv/top_center_lidar",
    "trajectories/novatel_ins_csv/top_center_lidar-enu.txt"
)]
fn walls_of_recorded_sweeps_are_thin_by_the_given_path() {
    let folder = tempfile::tempdir().unwrap();
    let lidar = folder.path().join("lidar");
    std::fs::create_dir(&lidar).unwrap();
    let source = real_data::path("trajectories/novatel_ins_csv/top_center_lidar");
    let mut names: Vec<_> = std::fs::read_dir(&source).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    for name in &names[1..] {
        std::os::unix::fs::symlink(source.join(name), lidar.join(name)).unwrap();
    }
    // The names end with milliseconds of 08:21:29 UTC.
    let begins = [468, 568, 668, 768].map(|ms| (1_635_236_489_000_i64 + ms) * 1_000_000);
    let times = begins.map(|begin| begin.to_string()).join("\n");
    std::fs::write(lidar.join("times.txt"), times).unwrap();
    let text =
        std::fs::read_to_string(real_data::path("trajectories/novatel_ins_csv/top_center_lidar-enu.txt")).unwrap();
    let mut path = Trajectory::default();
    for (number, line) in (0..).zip(text.lines().take(20)) {
        let numbers: Vec<f64> = line.split_whitespace().skip(1).map(|field| field.parse().unwrap()).collect();
        let row = |row: usize| Vector3::new(numbers[row * 4], numbers[row * 4 + 1], numbers[row * 4 + 2]).transpose();
        let matrix = nalgebra::Matrix3::from_rows(&[row(0), row(1), row(2)]);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(matrix);
        let pose = Isometry3::from_parts(
            geometry::Translation3::new(numbers[3], numbers[7], numbers[11]),
            geometry::UnitQuaternion::from_rotation_matrix(&rotation),
        );
        // The first pose is of 468 ms, at the start of the second sweep.
        path.push(Stamp(begins[0] - 1_000_000 + number * 100_000_000), pose);
    }
    std::fs::write(folder.path().join("path.txt"), formats::trajectory::tum_from_trajectory(&path)).unwrap();
    let toml = "version = 1\nname = \"car\"\n[lidar]\nmodel = \"hdl64e\"\nformat = \"pcd\"\nfolder = \"lidar\"\n\
                body_from_lidar = { translation = [0, 0, 0], rotation = [0, 0, 0, 1] }\n\
                [trajectory]\nfile = \"path.txt\"\nformat = \"tum\"\n";
    std::fs::write(folder.path().join("drive.toml"), toml).unwrap();
    let drive = drive::Drive::open(folder.path()).unwrap();
    let mut source = drive.sweeps().unwrap();
    let mut bench = bench(&context(folder.path()));
    let mut n_sweeps = 0;
    loop {
        let mut rows = Vec::new();
        let Some(sweep) = source.next_sweep(|points| rows.extend_from_slice(points)).unwrap() else { break };
        assert!(sweep.has_times);
        let header =
            SweepHeader { duration_nanos: sweep.duration_nanos, lost_packets: 0, n_rings: 64, has_times: 1, lidar: 0 };
        feed(&mut bench, &RawSweep { stamp: sweep.stamp.0, header, rows });
        n_sweeps += 1;
    }
    bench.finish().unwrap();
    assert_eq!(n_sweeps, 4);
    let submaps = bench.take::<SubmapTopic>();
    let points: Vec<Vector3<f64>> = submaps
        .iter()
        .flat_map(|submap| submap.rows().iter().map(|row| Vector3::new(row.x, row.y, row.z).cast::<f64>()))
        .collect();
    let walls = wall_thicknesses(&points);
    let median_m = walls[walls.len() / 2];
    eprintln!(
        "{} walls, median thickness {:.4} m, 90 % below {:.4} m",
        walls.len(),
        median_m,
        walls[walls.len() * 9 / 10]
    );
    assert!(walls.len() > 50, "{} walls", walls.len());
    assert!(median_m < 0.03, "{median_m} m");
}

/// Standard deviations across the vertical planes in cells of a metre within 60 m, ascending, m.
fn wall_thicknesses(points: &[Vector3<f64>]) -> Vec<f64> {
    let mut cells = std::collections::BTreeMap::<[i64; 3], Vec<Vector3<f64>>>::new();
    for p in points.iter().filter(|p| p.norm() < 60.0) {
        cells.entry([p.x, p.y, p.z].map(|v| v.floor() as i64)).or_default().push(*p);
    }
    let thickness = |points: &Vec<Vector3<f64>>| {
        let n = points.len() as f64;
        let mean = points.iter().sum::<Vector3<f64>>() / n;
        let covariance = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<nalgebra::Matrix3<f64>>() / n;
        let eigen = covariance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let normal = eigen.eigenvectors.column(order[0]);
        let is_wall = eigen.eigenvalues[order[1]] > 0.02 && normal[2].abs() < 0.2;
        is_wall.then(|| eigen.eigenvalues[order[0]].max(0.0).sqrt())
    };
    let mut found: Vec<f64> =
        cells.values().filter(|points| points.len() >= 30).filter_map(thickness).filter(|m| *m < 0.1).collect();
    found.sort_by(f64::total_cmp);
    found
}
