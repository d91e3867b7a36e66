//! Comparison of the scores with evo and the KITTI development kit.

use super::*;
use clap::Parser;
use command_line::argument::Cli;
use geometry::{Pose, Stamp, Vector3};

fn parse(words: &[&str]) -> Args {
    Cli::parse_from([&[""], words].concat()).args
}

/// A curved trajectory with 10 poses per second at 12 m/s, and an estimate of it with drift, in another world frame.
fn trajectories() -> [Trajectory; 2] {
    let elsewhere = Pose::new(Vector3::new(100.0, -20.0, 3.0), Vector3::z() * 0.7);
    let mut both = [Trajectory::default(), Trajectory::default()];
    for i in 0..300_i64 {
        let s = i as f64 * 1.2;
        let place = Vector3::new(s, 15.0 * (s / 40.0).sin(), 0.4 * (s / 25.0).cos());
        let turn = Vector3::new(0.01 * (s / 10.0).sin(), 0.02 * (s / 15.0).cos(), (0.375 * (s / 40.0).cos()).atan());
        let drift = Pose::new(Vector3::new(0.004 * s, 0.3 * (s / 70.0).sin(), 0.001 * s), Vector3::z() * 0.0001 * s);
        let truth = Pose::new(place, turn);
        let stamp = Stamp(1_700_000_000_000_000_000 + i * 100_000_000);
        both[0].push(stamp, truth);
        both[1].push(stamp, elsewhere.inverse() * truth * drift);
    }
    both
}

fn write_both(folder: &Path) -> [String; 2] {
    let [truth, estimate] = trajectories();
    let paths = ["truth.txt", "estimate.csv"].map(|name| folder.join(name).to_string_lossy().into_owned());
    std::fs::write(&paths[0], tum_from_trajectory(&truth)).expect("writes");
    std::fs::write(&paths[1], csv_from_trajectory(&estimate)).expect("writes");
    paths
}

/// Numbers of `evo_ape tum … -a`, `evo_rpe tum … -d 1 -u f`, `evo_rpe … -d 10 -u m` (evo 1.38.1) and of the development kit's
/// formula on the same two trajectories: `lab/peers/trajectory.py --frozen` prints them.
#[test]
fn scores_equal_those_of_evo_and_of_the_kitti_kit() {
    let folder = tempfile::tempdir().expect("a folder");
    let [truth, estimate] = write_both(folder.path());
    let report = evaluate(&parse(&[&truth, &estimate])).expect("evaluates").expect("has pairs");
    let json = report.json();
    let of = |error: usize, name: &str| json["errors"][error]["of"][name].as_f64().expect("a number");
    for (error, name, expected) in FROZEN {
        let found = of(error, name);
        assert!(
            (found - expected).abs() < 1e-6,
            "{} {name}: {found}, evo has {expected}",
            json["errors"][error]["error"]
        );
    }
    let all = report.segment_rows().pop().expect("has segments");
    let is_near = |found: f64, expected: f64| (found - expected).abs() < 1e-6;
    assert!(is_near(all.translation_percent, KIT[0]) && is_near(all.rotation_deg_per_100_m, KIT[1]), "{all:?}");
}

const FROZEN: [(usize, &str, f64); 24] = [
    (0, "rmse", 0.444_126_600),
    (0, "mean", 0.387_216_115),
    (0, "median", 0.406_793_251),
    (0, "max", 0.773_751_948),
    (1, "rmse", 1.261_518_060),
    (1, "mean", 1.113_370_007),
    (1, "median", 1.112_213_706),
    (1, "max", 2.139_527_366),
    (2, "rmse", 0.030_977_278),
    (2, "mean", 0.026_357_253),
    (2, "median", 0.018_453_929),
    (2, "max", 0.053_696_918),
    (3, "rmse", 0.007_077_357),
    (3, "mean", 0.007_073_381),
    (3, "median", 0.006_978_003),
    (3, "max", 0.007_872_366),
    (4, "rmse", 0.261_909_410),
    (4, "mean", 0.221_266_568),
    (4, "median", 0.160_432_156),
    (4, "max", 0.477_503_917),
    (5, "rmse", 0.060_485_171),
    (5, "mean", 0.060_343_747),
    (5, "median", 0.061_957_160),
    (5, "max", 0.068_875_381),
];
const KIT: [f64; 2] = [1.213_643_301, 0.557_133_503];

#[test]
fn written_trajectories_can_be_evaluated_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let [truth, estimate] = write_both(folder.path());
    let out = folder.path().join("out");
    let out_word = out.to_string_lossy();
    for (format, name) in [("kitti", "txt"), ("csv", "csv"), ("tum", "txt")] {
        run(&parse(&[&truth, &estimate, "--out", &out_word, "--write", format])).expect("runs");
        let [truth, estimate] =
            ["truth", "estimate"].map(|side| out.join(format!("{side}.{name}")).to_string_lossy().into_owned());
        let times = out.join("times.txt").to_string_lossy().into_owned();
        let mut words = vec![truth.as_str(), &estimate, "--align", "none"];
        if format == "kitti" {
            words.extend(["--truth-times", &times, "--times", &times]);
        }
        let again = evaluate(&parse(&words)).expect("evaluates").expect("has pairs");
        assert_eq!(again.pairs.len(), 300);
        // The written trajectories are already aligned.
        let rmse = again.json()["errors"][0]["of"]["rmse"].as_f64().expect("a number");
        assert!((rmse - FROZEN[0].2).abs() < 1e-6, "{format}: {rmse}");
    }
    for name in ["trajectory.svg", "errors.svg"] {
        let svg = std::fs::read_to_string(out.join(name)).expect("is there");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN"), "{name}");
    }
    assert_eq!(std::fs::read_to_string(out.join("poses.csv")).expect("is there").lines().count(), 301);
}

#[test]
fn run_folder_provides_trajectory_and_step_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let [truth, estimate] = trajectories();
    let truth_file = folder.path().join("truth.csv");
    std::fs::write(&truth_file, csv_from_trajectory(&truth)).expect("writes");
    std::fs::write(folder.path().join("trajectory.txt"), tum_from_trajectory(&estimate)).expect("writes");
    let summary = r#"{"stages": [{"name": "acquire"}, {"name": "slam_aggregate", "step": {"p50_ms": 18, "p99_ms": 51.7, "max_ms": 80}}]}"#;
    std::fs::write(folder.path().join("summary.json"), summary).expect("writes");
    let args = parse(&[&truth_file.to_string_lossy(), &folder.path().to_string_lossy()]);
    let text = evaluate(&args).expect("evaluates").expect("has pairs").markdown();
    assert!(text.contains("- step of slam_aggregate: median 18.0 ms, p99 51.7 ms, max 80.0 ms\n"), "{text}");
    assert!(text.contains("| position (ATE) | m | 300 | 0.4441 | 0.3872 | 0.4068 |"), "{text}");
}

#[test]
fn trajectories_without_pairs_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let [truth, estimate] = write_both(folder.path());
    let late = parse(&[&truth, &estimate, "--shift-ms", "60000"]);
    assert!(evaluate(&late).expect("evaluates").is_none());
    assert_eq!(run(&late).expect("runs"), ExitCode::from(exit_code::INCOMPLETE));
    let kitti = folder.path().join("kitti.txt");
    std::fs::write(&kitti, kitti_from_trajectory(&trajectories()[1])).expect("writes");
    let error = run(&parse(&[&truth, &kitti.to_string_lossy()])).expect_err("has no stamps").to_string();
    assert!(error.contains("kitti.txt: poses without times\nhint: --times"), "{error}");
}
