//! A long drive with loops: 10 km of laps of 1.5 km through the simulated town, with LiDAR, inertial unit and GNSS
//! receiver. Memory must not grow, and drift and position are compared with the ground truth. The drive is simulated if
//! it does not exist (`target/long_drive`, 5 MB a second).
//! `cargo build --release && cargo build --release -p replica_lab && cargo bench -p replica-tests --bench long_drive [-- SECONDS SEED]`

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// 1850 s are a little more than 10 km at the speed of the simulated traffic.
const SECONDS: u64 = 1850;
const SEED: u64 = 601;
/// Growth of a process from the second quarter of the drive to the last one that does not count as a leak: its share,
/// and bytes. All places of the laps are known by then; poses and fixes of the pose graph still arrive.
const GROWTH_SHARE: f64 = 0.1;
const GROWTH_BYTES: f64 = 16e6;
/// Largest errors. They detect lost odometry and a wrong placement, and are not accuracy goals.
const MAX_DRIFT_PERCENT: f64 = 1.0;
const MAX_PLACE_M: f64 = 5.0;
/// Shorter drives have no second quarter to compare with.
const MIN_SECONDS_OF_MEMORY: u64 = 600;

/// Corrections of the odometry, `[slam_aggregate] correct`, and the alignment for the comparison of its trajectory.
const RUNS: [(&str, &str, &str); 3] = [
    ("odometry alone", "[]", "first"),
    ("loop closures", r#"["imu","loops"]"#, "first"),
    ("GNSS and loop closures", r#"["gnss","imu","loops"]"#, "none"),
];

fn main() -> ExitCode {
    let mut numbers = std::env::args().filter_map(|argument| argument.parse().ok());
    let seconds = numbers.next().unwrap_or(SECONDS);
    let seed = numbers.next().unwrap_or(SEED);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let drive = simulated(root, seconds, seed);
    println!(
        "| corrected by | path m | drift % | deg per 100 m | position RMSE m | at the end m | memory MB, 2nd and last quarter |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut faults = Vec::new();
    for (name, correct, align) in RUNS {
        let output = drive.with_extension("run");
        run(root, &drive, &output, correct);
        let scores = Scores::evaluate(root, &drive, &output, align);
        let [before, after] = memory(&output);
        println!(
            "| {name} | {:.0} | {} | {} | {:.2} | {:.2} | {:.0}, {:.0} |",
            scores.path_m,
            cell(scores.drift_percent),
            cell(scores.deg_per_100_m),
            scores.rmse_m,
            scores.end_m,
            before * 1e-6,
            after * 1e-6
        );
        if seconds >= MIN_SECONDS_OF_MEMORY && after > before * (1.0 + GROWTH_SHARE) + GROWTH_BYTES {
            faults.push(format!("{name}: memory grows from {before:.0} to {after:.0} bytes"));
        }
        if scores.drift_percent.is_some_and(|drift| drift > MAX_DRIFT_PERCENT) {
            faults.push(format!("{name}: drift of {} %", cell(scores.drift_percent)));
        }
        if correct.contains("gnss") && seconds >= MIN_SECONDS_OF_MEMORY && scores.rmse_m > MAX_PLACE_M {
            faults.push(format!("{name}: positions are {:.1} m off (RMSE)", scores.rmse_m));
        }
    }
    for fault in &faults {
        println!("FAULT {fault}");
    }
    if faults.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn cell(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), |value| format!("{value:.3}"))
}

fn simulated(root: &Path, seconds: u64, seed: u64) -> PathBuf {
    let folder = root.join("target/long_drive");
    std::fs::create_dir_all(&folder).expect("a folder");
    let drive = folder.join(format!("urban_{seed}_{seconds}s"));
    if !drive.is_dir() {
        let partial = drive.with_extension("partial");
        if partial.is_dir() {
            std::fs::remove_dir_all(&partial).expect("removes what an interrupted run left");
        }
        let status = Command::new(root.join("target/release/replica"))
            .args(["simulate", "--rig", "survey", "--seed", &seed.to_string(), "--seconds", &seconds.to_string()])
            .arg("--out")
            .arg(&partial)
            .stdout(std::process::Stdio::null())
            .status()
            .expect("built by `cargo build --release`");
        assert!(status.success(), "replica simulate: {status}");
        std::fs::rename(&partial, &drive).expect("the drive");
    }
    drive
}

fn run(root: &Path, drive: &Path, output: &Path, correct: &str) {
    let status = Command::new(root.join("target/release/replica-launch"))
        .arg(root.join("launch.toml"))
        .args(["--overwrite", "--without", "calibrate", "--without", "colorize", "--without", "infer"])
        .args(["--without", "instance", "--set", "export.formats=[]"])
        .args(["--set", &format!("run.drive={}", drive.display())])
        .args(["--set", &format!("run.output={}", output.display())])
        .args(["--set", &format!("slam_aggregate.correct={correct}")])
        .stderr(std::process::Stdio::null())
        .status()
        .expect("built by `cargo build --release`");
    // A run with doubts is also scored.
    assert!(matches!(status.code(), Some(0 | 3)), "replica-launch: {status}");
}

/// The trajectory against the ground truth.
struct Scores {
    path_m: f64,
    /// Drift over KITTI segments; `None` on a path below 100 m.
    drift_percent: Option<f64>,
    deg_per_100_m: Option<f64>,
    rmse_m: f64,
    end_m: f64,
}

impl Scores {
    fn evaluate(root: &Path, drive: &Path, output: &Path, align: &str) -> Self {
        let report = output.join("evaluation");
        let status = Command::new(root.join("target/release/replica-lab"))
            .args(["evaluate", "trajectory"])
            .args([drive, output])
            .args(["--align", align, "--out"])
            .arg(&report)
            .stdout(std::process::Stdio::null())
            .status()
            .expect("built by `cargo build --release -p replica_lab`");
        assert!(status.success(), "replica-lab evaluate: {status}");
        let text = std::fs::read(report.join("evaluation.json")).expect("written");
        let scores: Value = serde_json::from_slice(&text).expect("JSON");
        let segments = scores["segments"].as_array().cloned().unwrap_or_default();
        let all = segments.iter().find(|segment| segment["length_m"].is_null());
        let of_segments = |key: &str| all.and_then(|all| all[key].as_f64());
        let poses = std::fs::read_to_string(report.join("poses.csv")).expect("written");
        let last: Vec<&str> = poses.lines().last().expect("poses").split(',').collect();
        let number = |column: usize| last[column].parse().expect("a number");
        Self {
            path_m: number(1),
            drift_percent: of_segments("translation_percent"),
            deg_per_100_m: of_segments("rotation_deg_per_100_m"),
            rmse_m: scores["errors"][0]["of"]["rmse"].as_f64().expect("an error"),
            end_m: number(5),
        }
    }
}

/// Largest resident memory of `slam_aggregate` in the second and in the last quarter of the drive, bytes.
fn memory(output: &Path) -> [f64; 2] {
    let text = std::fs::read_to_string(output.join("run/costs.csv")).expect("written");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = |name: &str| names.iter().position(|found| *found == name).expect("a column");
    let stage = column("stage");
    let drive_s = column("drive_s");
    let resident = column("resident_bytes");
    let rows: Vec<(f64, f64)> = lines
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|fields| fields[stage] == "slam_aggregate")
        .filter_map(|fields| Some((fields[drive_s].parse().ok()?, fields[resident].parse().ok()?)))
        .collect();
    let end = rows.iter().map(|row| row.0).fold(0.0, f64::max);
    let largest = |low: f64, high: f64| {
        let part = rows.iter().filter(|row| (low * end..=high * end).contains(&row.0));
        part.map(|row| row.1).fold(0.0, f64::max)
    };
    [largest(0.25, 0.5), largest(0.75, 1.0)]
}
