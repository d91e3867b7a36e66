//! `replica-lab bench --compare`: exit codes and answers on a kept report.

use crate::support::{printed, replica_lab, succeeded, text};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A report of three runs in each configuration. An older version wrote it: with each number of cores it has two series.
const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../lab/runs/2026-11-23-388659e-sample.json");

/// Index of the stage `slam_aggregate` in it.
const SLAM: usize = 2;

/// A copy of the report with one series for each number of cores, after a change of its runs.
fn changed(folder: &Path, name: &str, change: impl Fn(&mut Vec<Value>)) -> PathBuf {
    let mut report: Value = serde_json::from_slice(&std::fs::read(KEPT).expect("a report")).expect("JSON");
    let all = report["series"].as_array_mut().expect("a list");
    all.retain(|series| series["configuration"]["transport"] == "shared");
    assert!(!all.is_empty());
    for series in all {
        change(series["runs"].as_array_mut().expect("a list"));
    }
    let path = folder.join(name);
    std::fs::write(&path, report.to_string()).expect("written");
    path
}

#[test]
fn regression_ends_with_1_and_equal_reports_with_0() {
    let folder = tempfile::tempdir().expect("a folder");
    let before = changed(folder.path(), "before.json", |_| ());
    let same = succeeded(&replica_lab(&["bench", "--compare", text(&before), text(&before), "--limit", "5"]));
    assert!(same.contains(" 0 worse, 0 better, 0 changed within the noise"), "{same}");
    let slower = changed(folder.path(), "slower.json", |runs| {
        for run in runs {
            let cpu_s = run["stages"][SLAM]["cpu_s"].as_f64().expect("a number");
            run["stages"][SLAM]["cpu_s"] = (cpu_s * 3.0 + 1.0).into();
        }
    });
    let found = replica_lab(&["bench", "--compare", text(&before), text(&slower), "--json"]);
    assert_eq!(found.status.code(), Some(1), "{}", printed(&found));
    let answer: Value = serde_json::from_slice(&found.stdout).expect("JSON");
    let rows = answer["rows"].as_array().expect("a list");
    let worse: Vec<&Value> = rows.iter().filter(|row| row["verdict"] == "worse").collect();
    assert!(!worse.is_empty());
    for row in worse {
        assert_eq!((&row["stage"], &row["figure"]), (&"slam_aggregate".into(), &"processor, s".into()), "{row}");
    }
}

#[test]
fn reports_that_cannot_be_compared_end_with_2_and_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let two = changed(folder.path(), "two.json", |runs| drop(runs.pop()));
    let before = changed(folder.path(), "before.json", |_| ());
    let invalid = folder.path().join("invalid.json");
    std::fs::write(&invalid, "{\"date\": 1}").expect("written");
    for (report, reason) in [
        (text(&two), "2 runs with 2 cores: a median needs at least 3"),
        (text(&invalid), "not a JSON report of `replica-lab bench`"),
        ("absent.json", "absent.json: "),
        (KEPT, "two series with 2 cores: written by an older version"),
    ] {
        let refused = replica_lab(&["bench", "--compare", text(&before), report]);
        assert_eq!(refused.status.code(), Some(2), "{report}: {}", printed(&refused));
        assert!(printed(&refused).contains(reason), "{}", printed(&refused));
    }
}
