//! `replica-lab evaluate OUT --truth DRIVE`.

use crate::finished_run::{FinishedRun, RunOptions, write_run};
use crate::support::{printed, replica_lab, simulate, succeeded, text};
use drive::Drive;
use messages::ClassId;
use serde_json::Value;
use settings::Word;
use simulation::{DriveSpec, RigSpec, Town};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A drive of two thirds of a second with only LiDAR and GNSS.
fn simulated(folder: &Path, town: &str) -> PathBuf {
    let drive = folder.join(town);
    let rig = RigSpec::built_in("survey").expect("is built in");
    let town = *Town::ALL.iter().find(|known| known.word() == town).expect("a town");
    simulate(&DriveSpec { town, rig, ..DriveSpec::urban(1, 0.65) }, &drive);
    drive
}

fn evaluate(run: &Path, drive: &Path, more: &[&str]) -> Output {
    replica_lab(&[&["evaluate", text(run), "--truth", text(drive)][..], more].concat())
}

fn scores(run: &Path, drive: &Path) -> Value {
    let out = run.join("evaluation");
    let said =
        succeeded(&evaluate(run, drive, &["--min-points", "5", "--instances", "pedestrian", "--out", text(&out)]));
    assert!(said.contains("## Classes") && said.contains("so colors are not scored"), "{said}");
    assert_eq!(std::fs::read_to_string(out.join("scores.md")).expect("was written"), said);
    serde_json::from_slice(&std::fs::read(out.join("scores.json")).expect("was written")).expect("is JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// IoU, precision and recall of a class, counted by hand.
fn by_hand(written: &FinishedRun, class: ClassId) -> [f64; 3] {
    let class = class as u8;
    let scored = || written.by_class.iter().filter(|((truth, _), _)| *truth != 0);
    let sum = |is: fn(u8, u8, u8) -> bool| -> f64 {
        scored().filter(|((truth, found), _)| is(*truth, *found, class)).map(|(_, n)| *n as f64).sum()
    };
    let both = sum(|truth, found, class| truth == class && found == class);
    let n_true = sum(|truth, _, class| truth == class);
    let n_found = sum(|_, found, class| found == class);
    [both / (n_true + n_found - both), both / n_found, both / n_true]
}

fn assert_scores_are_those_counted_by_hand(scores: &Value, written: &FinishedRun) {
    let points = &scores["points"];
    assert_eq!((points["n"].as_u64(), points["joined"].as_u64()), (Some(written.n_points), Some(written.n_points)));
    assert_eq!(points["share_joined"], 1.0);
    let unlabeled: u64 = written.by_class.iter().filter(|((truth, _), _)| *truth == 0).map(|(_, n)| n).sum();
    assert_eq!(points["unlabeled_in_truth"].as_u64(), Some(unlabeled));
    assert_eq!(scores["classes"]["n_points"].as_u64(), Some(written.n_points - unlabeled));

    let class = |class: ClassId| &scores["classes"]["classes"][class as usize];
    for (id, is_wrong) in [(ClassId::Road, true), (ClassId::Sidewalk, true), (ClassId::Building, false)] {
        let [iou, precision, recall] = by_hand(written, id);
        let found = class(id);
        for (name, expected) in [("iou", iou), ("precision", precision), ("recall", recall)] {
            assert!((number(&found[name]) - expected).abs() < 1e-12, "{id:?} {name}: {found}, expected {expected}");
        }
        assert_eq!(iou < 1.0, is_wrong, "{id:?}");
    }
    let road = ClassId::Road as u8;
    let sidewalk = ClassId::Sidewalk as u8;
    let moved = written.by_class[&(road, sidewalk)];
    assert!(moved > 500, "{moved} points of the road are called sidewalk");
    assert_eq!(scores["classes"]["confusion"][usize::from(road)][usize::from(sidewalk)].as_u64(), Some(moved));
    let present = ClassId::ALL
        .iter()
        .filter(|id| **id != ClassId::Unlabeled && written.by_class.keys().any(|(truth, _)| *truth == **id as u8));
    let ious: Vec<f64> = present.map(|id| by_hand(written, *id)[0]).collect();
    let mean = ious.iter().sum::<f64>() / ious.len() as f64;
    assert!((number(&scores["classes"]["mean_iou"]) - mean).abs() < 1e-12);

    // The found points of a person are some of the true ones.
    let shares = written.pedestrians.values().filter(|[n, _]| *n >= 5).map(|[n, kept]| *kept as f64 / *n as f64);
    let shares: Vec<f64> = shares.collect();
    let matched: Vec<f64> = shares.iter().copied().filter(|share| *share > 0.5).collect();
    assert!(!matched.is_empty(), "the street has people");
    let people = &scores["instances"][0];
    assert_eq!(people["true"].as_u64(), Some(shares.len() as u64));
    assert!((number(&people["sm"]) - matched.len() as f64 / shares.len() as f64).abs() < 1e-12, "{people}");
    let sq = matched.iter().sum::<f64>() / matched.len() as f64;
    assert!(sq < 0.9 && (number(&people["sq"]) - sq).abs() < 1e-12, "{people}, expected {sq}");

    assert_eq!(scores["color"]["by_camera"]["2"].as_u64(), Some(written.n_colored));
    assert_eq!(scores["color"]["true_colors"], Value::Null);
}

#[test]
fn scores_of_a_finished_run_equal_counts_by_hand() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = simulated(folder.path(), "urban");
    let run = folder.path().join("run");
    // East by 2 m and up by 1 m; the run states 1.5 m and 0.5 m.
    let written = write_run(&drive, &run, &RunOptions { off_m: [2.0, 1.0], ..RunOptions::default() });
    let scores = scores(&run, &drive);
    assert_scores_are_those_counted_by_hand(&scores, &written);

    let near = |value: &Value, expected: f64| (number(value) - expected).abs() < 2e-3;
    let [horizontal, height, heading] = [0, 1, 2].map(|k| &scores["absolute"][k]["of"]["max"]);
    assert!(near(horizontal, 2.0) && near(height, 1.0) && near(heading, 0.0), "{}", scores["absolute"]);
    let aligned = &scores["trajectory"]["errors"][0]["of"]["rmse"];
    assert!(near(aligned, 0.0), "a constant error vanishes by alignment: {aligned}");
    let stated = &scores["deviations"];
    assert_eq!((stated["in_world"].as_bool(), stated["submaps"].as_u64()), (Some(true), Some(written.n_submaps)));
    let ratio = |k: usize| number(&stated["quantities"][k]["ratio_rms"]);
    assert!((ratio(0) - 2.0 / 1.5).abs() < 2e-3 && (ratio(1) - 2.0).abs() < 4e-3, "{stated}");
    assert_eq!(stated["honest"].as_bool(), Some(true));

    // An error of four deviations of height is not consistent.
    let sure = folder.path().join("sure");
    write_run(&drive, &sure, &RunOptions { off_m: [0.0, 2.0], ..RunOptions::default() });
    let said = succeeded(&evaluate(&sure, &drive, &[]));
    assert!(said.contains("The run is overconfident: an error lies beyond three"), "{said}");
}

#[test]
fn truth_of_sweeps_without_point_times_is_found_by_ring_angle_and_range() {
    let folder = tempfile::tempdir().expect("a folder");
    let timed = simulated(folder.path(), "urban");
    let untimed = folder.path().join("untimed");
    let n_rings = rewritten_without_times(&timed, &untimed);
    assert!(n_rings > 20, "{n_rings} rings");
    // As the odometry sets them if its settings state that the sensor spins.
    let offset_nanos: [fn(&lidar::SweepPoint) -> u32; 2] = [|_| 0, |point| u32::from(point.azimuth) * 2_700];
    for (k, offset_nanos) in offset_nanos.into_iter().enumerate() {
        let run = folder.path().join(format!("run_{k}"));
        let written = write_run(&untimed, &run, &RunOptions { offset_nanos, ..RunOptions::default() });
        assert_scores_are_those_counted_by_hand(&scores(&run, &untimed), &written);
    }
}

/// A drive of the same sweeps as KITTI writes them: x y z intensity, no times, no rings. Returns the number of rings that they get.
fn rewritten_without_times(timed: &Path, untimed: &Path) -> usize {
    let drive = Drive::open(timed).expect("opens");
    let write = |name: &str, bytes: &[u8]| {
        let path = untimed.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, bytes).expect("writes");
    };
    let mut manifest = drive.manifest().clone();
    "bin".clone_into(&mut manifest.lidar.format);
    "lidar".clone_into(&mut manifest.lidar.folder);
    manifest.imu = None;
    let mut source = drive.sweeps().expect("opens");
    let mut times = String::new();
    let mut n_sweeps = 0;
    loop {
        let mut bytes = Vec::new();
        let next = source.next_sweep(|found| {
            for point in found {
                let intensity = f32::from(point.intensity) / 255.0;
                bytes.extend([point.x, point.y, point.z, intensity].into_iter().flat_map(f32::to_le_bytes));
            }
        });
        let Some(sweep) = next.expect("reads") else { break };
        write(&format!("lidar/{n_sweeps:06}.bin"), &bytes);
        let labels = timed.join(format!("truth/labels/{:06}.label", sweep.seq));
        write(&format!("truth/labels/{n_sweeps:06}.label"), &std::fs::read(labels).expect("reads"));
        writeln!(times, "{}", sweep.stamp.0).expect("a text grows");
        n_sweeps += 1;
    }
    write("lidar/times.txt", times.as_bytes());
    for name in ["gnss.nmea", "truth/trajectory.txt", "truth/gnss.csv", "truth/calibration.toml"] {
        if let Ok(bytes) = std::fs::read(timed.join(name)) {
            write(name, &bytes);
        }
    }
    write("drive.toml", toml::to_string(&manifest).expect("encodes").as_bytes());
    let mut rings = std::collections::BTreeSet::new();
    let mut source = Drive::open(untimed).expect("opens").sweeps().expect("opens");
    while source.next_sweep(|found| rings.extend(found.iter().map(|point| point.ring))).expect("reads").is_some() {}
    rings.len()
}

#[test]
fn run_of_another_drive_is_refused_with_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = simulated(folder.path(), "urban");
    let other = simulated(folder.path(), "suburban");
    let run = folder.path().join("run");
    let written = write_run(&drive, &run, &RunOptions::default());
    // Both drives have the same times and the same LiDAR: only the ranges differ.
    let output = evaluate(&run, &other, &[]);
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains(&format!("of {} points are returns of {}", written.n_points, other.display())), "{said}");
    assert!(said.contains("the return at this time has another angle or range"), "{said}");
    assert!(said.contains("hint: --truth must be the drive of the run"), "{said}");

    let late = folder.path().join("late");
    write_run(&drive, &late, &RunOptions { late_nanos: 3_600_000_000_000, ..RunOptions::default() });
    let output = evaluate(&late, &drive, &[]);
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let numbers = format!(
        "only 0 of {0} points are returns of {1} ({0} outside the labeled sweeps",
        written.n_points,
        drive.display()
    );
    assert!(said.contains(&numbers), "{said}");
}

#[test]
fn points_without_truth_are_counted_and_few_of_them_change_the_exit_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = simulated(folder.path(), "urban");
    let run = folder.path().join("run");
    write_run(&drive, &run, &RunOptions::default());
    // One of several clouds is an hour late.
    let late = folder.path().join("late");
    write_run(&drive, &late, &RunOptions { late_nanos: 3_600_000_000_000, ..RunOptions::default() });
    let cloud = "clouds/submap_0001.ply";
    std::fs::copy(late.join(cloud), run.join(cloud)).expect("copies");
    let output = evaluate(&run, &drive, &["--min-joined", "99"]);
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(
        said.contains("points without a true label: ") && said.contains(": outside the labeled sweeps of the drive"),
        "{said}"
    );
    assert!(said.contains("less than --min-joined 99 %"), "{said}");
    assert_eq!(evaluate(&run, &drive, &["--min-joined", "20"]).status.code(), Some(0));
}

#[test]
fn points_of_unlabeled_sweeps_are_counted_apart_and_only_others_change_the_exit_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = simulated(folder.path(), "urban");
    let run = folder.path().join("run");
    let written = write_run(&drive, &run, &RunOptions::default());
    let late = folder.path().join("late");
    write_run(&drive, &late, &RunOptions { late_nanos: 3_600_000_000_000, ..RunOptions::default() });
    // Labels of two key frames.
    let labels = drive.join("truth/labels");
    let n_sweeps = std::fs::read_dir(&labels).expect("lists").count();
    for seq in (0..n_sweeps).filter(|seq| ![1, 4].contains(seq)) {
        std::fs::remove_file(labels.join(format!("{seq:06}.label"))).expect("removed");
    }
    let out = run.join("evaluation");
    let said = succeeded(&evaluate(&run, &drive, &["--out", text(&out)]));
    assert!(said.contains(&format!("- unlabeled sweeps: {} of {n_sweeps}\n", n_sweeps - 2)), "{said}");
    let scores: Value =
        serde_json::from_slice(&std::fs::read(out.join("scores.json")).expect("was written")).expect("is JSON");
    let points = &scores["points"];
    let count = |name: &str| points[name].as_u64().expect("a count");
    assert_eq!(count("joined") + count("in_unlabeled_sweeps"), written.n_points);
    assert!(count("joined") * 2 < written.n_points && count("joined") > 0, "{points}");
    assert_eq!(points["share_joined"], 1.0);

    // Points that are returns of no sweep raise a doubt: one of the clouds is an hour late.
    let cloud = "clouds/submap_0001.ply";
    std::fs::copy(late.join(cloud), run.join(cloud)).expect("copies");
    let output = evaluate(&run, &drive, &["--min-joined", "99"]);
    let said = printed(&output);
    assert!(said.contains("of the points have a true label, less than --min-joined 99 %"), "{said}");
    assert_eq!(output.status.code(), Some(3), "{said}");

    // Without labels in the sweeps of the run there is nothing to score.
    std::fs::rename(labels.join("000001.label"), labels.join("000999.label")).expect("renamed");
    std::fs::remove_file(labels.join("000004.label")).expect("removed");
    let output = evaluate(&run, &drive, &[]);
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    // Which one depends on whether the run reaches the end of the drive.
    assert!(said.contains("contains no label file of a sweep") || said.contains("have no labels"), "{said}");
}

#[test]
fn wrong_arguments_and_folders_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = simulated(folder.path(), "urban");
    let run = folder.path().join("run");
    write_run(&drive, &run, &RunOptions::default());
    let refused = |arguments: &[&str], code: i32, words: &str| {
        let output = replica_lab(&[&["evaluate"], arguments].concat());
        let said = printed(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {words:?} is not in\n{said}");
    };
    refused(&[text(&run)], 2, "--truth");
    refused(&[], 2, "Usage: replica-lab evaluate");
    refused(&[text(&run), "--truth", text(&run)], 1, "no drive.toml; --truth must be a drive folder");
    refused(&[text(&folder.path().join("none")), "--truth", text(&drive)], 1, "not the output folder of a run");
    refused(&[text(&drive), "--truth", text(&drive)], 1, "no clouds (*.ply)");
    refused(&[text(&run), "--truth", text(&drive), "--instances", "cars"], 2, "unknown class \"cars\"");
    // The subcommands still exist.
    refused(&["trajectory", text(&drive)], 2, "<ESTIMATE>");

    std::fs::remove_file(run.join("clouds/index.json")).expect("removed");
    std::fs::remove_file(run.join("georeference.json")).expect("removed");
    let said = succeeded(&evaluate(&run, &drive, &[]));
    assert!(said.contains("None: the run was not moved to its final frame."), "{said}");
    assert!(said.contains("The run states none."), "{said}");
    std::fs::remove_file(drive.join("truth/labels/000002.label")).expect("removed");
    let said = succeeded(&evaluate(&run, &drive, &[]));
    assert!(said.contains("- unlabeled sweeps: 1 of 7\n"), "{said}");
    let manifest = std::fs::read_to_string(drive.join("drive.toml")).expect("reads");
    std::fs::write(drive.join("drive.toml"), manifest.replace("labels = \"truth/labels\"", "")).expect("writes");
    let said = succeeded(&evaluate(&run, &drive, &[]));
    assert!(said.contains("the drive has no true labels") && said.contains("## Trajectory"), "{said}");
}
