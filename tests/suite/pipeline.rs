//! The real stages as processes: the files of a run, and the same bytes for the same input whatever happens to the processes.

use drive::Drive;
use formats::ply::Vertices;
use formats::trajectory::{poses_from_kitti, trajectory_from_tum};
use geometry::Trajectory;
use replica_tests::{Launch, binary, drive, is_alive, output_text, pipeline, reference, result_files, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;

fn launch(infer: &str) -> Launch {
    pipeline(&drive(), "", infer)
}

/// Result of an undisturbed run.
fn undisturbed() -> BTreeMap<String, Vec<u8>> {
    reference("pipeline", || launch(""))
}

fn assert_same(expected: &BTreeMap<String, Vec<u8>>, got: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>(), "{what}: other files");
    for (name, bytes) in expected {
        assert!(*bytes == got[name], "{what}: {name} differs");
    }
}

/// Largest distance between the positions of two trajectories with their first poses aligned.
fn largest_error_m(estimate: &Trajectory, truth: &Trajectory) -> f64 {
    let (first_stamp, first) = estimate.poses()[0];
    let truth_from_estimate = truth.at(first_stamp).expect("the truth covers the drive") * first.inverse();
    let errors = estimate.poses().iter().filter_map(|(stamp, pose)| {
        let difference = truth.at(*stamp)?.translation.vector - (truth_from_estimate * pose).translation.vector;
        Some(difference.norm())
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn run_writes_clouds_trajectory_and_summary() {
    let launch = launch("");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));

    let drive = Drive::open(&drive()).expect("a drive");
    let truth = drive.true_trajectory().expect("simulated drives have truth").expect("TUM");
    let estimate = trajectory_from_tum(&String::from_utf8(launch.read("trajectory.txt")).expect("text")).expect("TUM");
    assert!(truth.length_m() > 5.0, "the vehicle moves");
    let error_m = largest_error_m(&estimate, &truth);
    assert!(error_m < 0.15, "the trajectory is off by {error_m} m on {} m", truth.length_m());

    let files = result_files(&launch.output());
    let clouds: Vec<&String> = files.keys().filter(|n| n.starts_with("submap_") && !n.contains("spectra")).collect();
    assert!(clouds.len() >= 2, "{:?}", files.keys());
    let mut n_points = 0;
    let mut n_colored = 0;
    let mut n_ground = 0;
    for name in clouds {
        let cloud = Vertices::load(&launch.output().join("clouds").join(name)).expect("a PLY file");
        let column = |field: &str| cloud.f64s(field).unwrap_or_else(|error| panic!("{name}: {error}"));
        n_points += cloud.len();
        n_colored += column("camera").iter().filter(|camera| **camera != 255.0).count();
        n_ground += column("semantic").iter().filter(|class| **class == 14.0).count();
        for field in ["x", "red", "green", "blue", "instance", "intensity", "timestamp", "x_lidar_position"] {
            assert_eq!(column(field).len(), cloud.len());
        }
    }
    let summary = launch.summary();
    assert_eq!(summary["outcome"], "done");
    assert_eq!(summary["total"]["points"], n_points);
    assert!(n_colored * 2 > n_points, "{n_colored} of {n_points} points have a color");
    assert!((0.25..0.75).contains(&(n_ground as f64 / n_points as f64)), "{n_ground} of {n_points} points are ground");
    for stage in ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"] {
        let stage = launch.stage_summary(stage);
        assert!(stage["ticks"].as_u64() >= Some(28), "{stage}");
        assert!(stage["cpu_s"].as_f64() > Some(0.0) && stage["peak_rss_bytes"].as_u64() > Some(1 << 20), "{stage}");
    }
}

#[test]
fn threads_and_timing_do_not_change_the_result() {
    let one_thread = launch("");
    let output = one_thread.run_with_env("RAYON_NUM_THREADS", "1");
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert_same(&undisturbed(), &result_files(&one_thread.output()), "one thread");

    // A stage that is stopped repeatedly delays all others; no data may be lost.
    let slowed = launch("");
    let running = slowed.start();
    let colorize = running.stage("colorize");
    for _ in 0..20 {
        interrupt(colorize);
    }
    assert_eq!(running.wait(), Some(0));
    assert_same(&undisturbed(), &result_files(&slowed.output()), "a slow stage");
}

/// Stops a process, waits until it is stopped, and continues it.
fn interrupt(pid: Pid) {
    let state = || {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", pid.as_raw_nonzero())).ok()?;
        stat.rsplit(')').next()?.trim().chars().next()
    };
    if !is_alive(pid) || kill_process(pid, Signal::STOP).is_err() {
        return;
    }
    wait_for("the stop", || (state() == Some('T') || !is_alive(pid)).then_some(()));
    // It may have been killed or ended in between.
    let _ = kill_process(pid, Signal::CONT);
    std::thread::park_timeout(std::time::Duration::from_millis(20));
}

#[test]
fn killed_stage_does_not_change_the_result() {
    for stage in ["slam_aggregate", "export"] {
        // On a busy machine the run may end before the kill; then another run is killed.
        let launch = wait_for("a kill in the middle of the drive", || {
            let launch = launch("");
            let running = launch.start();
            launch.wait_for_barrier(1);
            let was_killed = running.find_stage(stage).is_some_and(|pid| kill_process(pid, Signal::KILL).is_ok());
            assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
            (was_killed && launch.stage_summary(stage)["faults"] == 1).then_some(launch)
        });
        assert_same(&undisturbed(), &result_files(&launch.output()), stage);
    }
}

#[test]
fn foreign_program_replaces_a_stage() {
    let infer = format!("program = '{}'", binary("height-segmenter").display());
    let launch = launch(&infer);
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(launch.stage_summary("infer")["program"].as_str().expect("text").ends_with("height-segmenter"));
    let instances = launch.stage_summary("instance")["counters"]["instances"].as_u64();
    assert!(instances > Some(0), "it finds vehicles, so there are instances: {instances:?}");
    let expected = undisturbed();
    let swapped = result_files(&launch.output());
    assert!(swapped["trajectory.txt"] == expected["trajectory.txt"], "results of earlier stages are unchanged");
    assert!(swapped["submap_0000.ply"] != expected["submap_0000.ply"]);
}

#[real_data::test("kitti_raw_0048")]
fn real_sweeps_without_cameras_are_mapped() {
    let drive = real_data::path("kitti_raw_0048");
    let launch = pipeline(&drive, "", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(
        output_text(&output).contains("no cameras in this drive: points stay without color"),
        "{}",
        output_text(&output)
    );
    let estimate = trajectory_from_tum(&String::from_utf8(launch.read("trajectory.txt")).expect("text")).expect("TUM");
    // The references go from the middle of the first sweep to the middle of the last. The path starts there, because sweeps are
    // rigid until the spin direction is known, and it ends with the last shot of the last sweep.
    let mut last = estimate.poses().iter().rev().map(|(_, pose)| pose.translation.vector);
    let last_shot = last.next().expect("poses");
    let first_shot = last.next().expect("poses");
    let end = (first_shot + last_shot) / 2.0;
    let length_m = estimate.length_m() - (last_shot - end).norm();
    let mut ends = Vec::new();
    for name in ["ref_traj_kiss_icp_1.3.0.txt", "ref_traj_small_gicp_f2f.txt"] {
        let poses = poses_from_kitti(&std::fs::read_to_string(drive.join(name)).expect("text")).expect("KITTI");
        let mut reference = Trajectory::default();
        for (index, pose) in poses.into_iter().enumerate() {
            reference.push(geometry::Stamp(index as i64), pose);
        }
        let ratio = length_m / reference.length_m();
        assert!((0.98..1.02).contains(&ratio), "the path is {ratio} times as long as the path of {name}");
        let off = (end - reference.poses().last().expect("poses").1.translation.vector).norm();
        assert!(off < 0.3, "the end is {off} m from the end of {name}");
        ends.push(off);
    }
    println!("end points are {ends:.3?} m from the references");
    let n_points: usize = result_files(&launch.output())
        .keys()
        .filter(|name| name.starts_with("submap_"))
        .map(|name| Vertices::load(&launch.output().join("clouds").join(name)).expect("a PLY file").len())
        .sum();
    assert_eq!(launch.summary()["total"]["points"], n_points);
    assert!(n_points > 22 * 100_000, "{n_points}");
}
