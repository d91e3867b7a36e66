//! `replica-lab evaluate classes` on small files.

use crate::support::{printed, replica_lab, succeeded, text};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name)
}

/// Ids of the data set's label files.
const ROAD: u32 = 40;
const LANE_MARKING: u32 = 60;
const MOVING_CAR: u32 = 252;
const OTHER_OBJECT: u32 = 99;

/// A sweep of a sensor 1.73 m above a road, 3 to 45 m away, with a box that has two labels. The instance is in the upper half of a label.
fn write_sweep(sequence: &Path, number: usize, intensity: f32) {
    let mut cloud = Vec::new();
    let mut labels = Vec::new();
    for ring in 0..60_u8 {
        for step in 0..900_u16 {
            let angle = (f32::from(step) * 0.4).to_radians();
            let range_m = 3.0 + 0.7 * f32::from(ring);
            let x = range_m * angle.cos();
            let y = range_m * angle.sin();
            let (z, label) = match (ring, step) {
                (10..=12, 100..=140) => (-1.0, MOVING_CAR | 7 << 16),
                (13, 100..=140) => (-1.0, OTHER_OBJECT),
                (_, 0..=3) => (-1.73, LANE_MARKING),
                _ => (-1.73, ROAD),
            };
            cloud.extend([x, y, z, intensity].map(f32::to_le_bytes).concat());
            labels.extend(label.to_le_bytes());
        }
    }
    for (folder, ending, bytes) in [("velodyne", "bin", cloud), ("labels", "label", labels)] {
        let folder = sequence.join(folder);
        std::fs::create_dir_all(&folder).expect("creates");
        std::fs::write(folder.join(format!("{number:06}.{ending}")), bytes).expect("writes");
    }
}

fn json(arguments: &[&str]) -> Value {
    let output = replica_lab(&[&["evaluate", "classes", "--format", "json"], arguments].concat());
    assert!(output.status.success(), "{}", printed(&output));
    serde_json::from_slice(&output.stdout).expect("stdout is JSON")
}

#[test]
fn sequence_in_layout_of_semantic_kitti_is_scored_with_and_without_intensities() {
    let root = tempfile::tempdir().expect("a folder");
    let sequence = root.path().join("dataset/sequences/08");
    let out = root.path().join("scores");
    write_sweep(&sequence, 0, 0.05);
    write_sweep(&sequence, 1, 0.3);
    let street = model("street.safetensors");
    let of_model = ["--model", text(&street), "--semantickitti", text(root.path())];
    let scores = json(&[&of_model[..], &["--out", text(&out)]].concat());
    assert_eq!(scores.as_array().map(Vec::len), Some(1));
    let scores = &scores[0];
    // 41 points of each sweep are other objects, which are not scored.
    assert_eq!((&scores["cloud"], &scores["n_points"]), (&"08".into(), &(2 * (60 * 900 - 41)).into()));
    assert_eq!(
        (&scores["n_sweeps"], &scores["note"]),
        (&2.into(), &"2 sweeps: not comparable with published benchmarks".into())
    );
    let n_of = |list: &Value, name: &str| {
        let class = list.as_array().expect("a list").iter().find(|class| class["class"] == name).expect("a class");
        class["n_truth"].as_u64().expect("a number")
    };
    assert_eq!((n_of(&scores["classes"], "vehicles"), n_of(&scores["classes"], "road-line")), (2 * 3 * 41, 0));
    assert_eq!(n_of(&scores["seven_classes"]["classes"], "vehicle"), 2 * 3 * 41);
    let uses: Vec<&str> = scores["other_intensities"]
        .as_array()
        .expect("sweeps with intensities")
        .iter()
        .map(|of| of["intensity"].as_str().expect("a word"))
        .collect();
    assert_eq!(uses, ["raw", "off"]);
    let n_in_ranges: u64 = scores["ranges"]
        .as_array()
        .expect("ranges")
        .iter()
        .map(|range| range["n_points"].as_u64().expect("a number"))
        .sum();
    assert_eq!(n_in_ranges, 2 * (60 * 900 - 41));

    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert!(read("scores.md").contains("SemanticKITTI: 2 sweeps: not comparable with published benchmarks."));
    assert_eq!(&serde_json::from_str::<Value>(&read("scores.json")).expect("JSON")[0], scores);
    assert!(read("coverage.svg").contains("</svg>"));

    // Every score is below 1, or nearly: a threshold takes the class of some points.
    let kept = &scores["coverage"]["thresholds"][6];
    assert_eq!(kept["min_score"], 0.9);
    let unknown = json(&[&of_model[..], &["--unknown-below", "0.9"]].concat());
    let share = 1.0 - unknown[0]["n_unknown"].as_f64().expect("a number") / (2.0 * (60.0 * 900.0 - 41.0));
    assert!(share < 1.0 && (share - kept["kept"].as_f64().expect("a number")).abs() < 1e-9, "{share} for {kept}");
}

#[test]
fn each_sensor_gets_a_line_and_unknown_names_are_refused() {
    let ground = model("ground.safetensors");
    let drive = ["--model", text(&ground), "--towns", "field", "--seeds", "9001", "--seconds", "1"];
    let small = [&["evaluate", "classes"], &drive[..], &["--submaps", "1", "--sweeps", "1"]].concat();
    let both = succeeded(&replica_lab(&[&small[..], &["--sensor", "rig,kitti"]].concat()));
    for line in [
        "| rig-field-9001 | 1 |",
        "| kitti-field-9001 | 1 |",
        "| **simulated, rig** | 1 |",
        "| **simulated, kitti** | 1 |",
    ] {
        assert!(both.contains(line), "{line}\n is not in\n{both}");
    }
    let alone = succeeded(&replica_lab(&small));
    assert!(alone.contains("### field-9001\n") && !alone.contains("kitti"), "{alone}");
    for (option, value) in [("--sensor", "lidar"), ("--unknown-below", "1.1"), ("--unknown-below", "nan")] {
        let output = replica_lab(&[&small[..], &[option, value]].concat());
        assert_eq!(output.status.code(), Some(2), "{option} {value}: {}", printed(&output));
    }
}

/// Equal labels in files have no scores and no positions: those tables are left out.
#[test]
fn label_files_are_scored_by_both_class_tables() {
    let root = tempfile::tempdir().expect("a folder");
    let write = |name: &str, classes: [u32; 4]| {
        let path = root.path().join(name);
        std::fs::write(&path, classes.map(u32::to_le_bytes).concat()).expect("writes");
        path
    };
    // Unlabeled, building, wall, road; wall and building are manmade.
    let truth = write("truth.label", [0, 1, 11, 7]);
    let predicted = write("predicted.label", [7, 11, 11, 6]);
    let scores = json(&[text(&truth), text(&predicted)]);
    assert_eq!(scores[0]["overall_accuracy"], 1.0 / 3.0);
    assert_eq!(scores[0]["seven_classes"]["overall_accuracy"], 1.0);
    assert!(scores[0]["calibration_error"].is_null() && scores[0]["ranges"].is_null());
}
