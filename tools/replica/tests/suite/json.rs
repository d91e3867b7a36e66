//! `--json`: one JSON object on stdout, with the facts of the text.

use crate::support::{replica, text};
use serde_json::Value;
use std::path::Path;

/// The object that a command prints on stdout, and nothing else.
fn object(arguments: &[&str]) -> Value {
    let output = replica(&[arguments, &["--json"]].concat());
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let value: Value = serde_json::from_str(&stdout).unwrap_or_else(|error| panic!("{error}: {stdout}\n{said}"));
    assert!(value.is_object(), "{stdout}");
    value
}

/// Two objects, as a run would write them.
fn write_cloud(path: &Path) {
    use std::fmt::Write as _;
    let mut ply = String::from("ply\nformat ascii 1.0\nelement vertex 8\n");
    for property in ["float x", "float y", "float z", "uchar semantic", "int instance"] {
        let _ = writeln!(ply, "property {property}");
    }
    ply.push_str("end_header\n");
    for k in 0..8 {
        let x = k % 4;
        let instance = 1 + k / 4;
        let _ = writeln!(ply, "{x} {instance} 0.5 10 {instance}");
    }
    std::fs::write(path, ply).expect("written");
}

#[test]
fn clouds_drives_and_objects_are_one_object_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let cloud = folder.path().join("cloud.ply");
    write_cloud(&cloud);
    let facts = object(&["inspect", text(&cloud)]);
    assert_eq!(facts["points"], 8);
    assert_eq!(facts["bounds_m"][1][0], 3.0);
    assert_eq!(facts["classes"][0]["name"], "vehicles");
    let objects = object(&["instances", text(&cloud)]);
    assert_eq!(objects["objects"].as_array().expect("a list").len(), 2);
    assert_eq!(objects["objects"][1]["points"], 4);
    let drive = folder.path().join("drive");
    assert!(replica(&["simulate", "--seconds", "0.3", "--out", text(&drive)]).status.success());
    let facts = object(&["inspect", text(&drive)]);
    assert!(facts["sensors"].as_array().expect("a list").len() > 3 && facts["doubts"].is_array(), "{facts}");
}

#[test]
fn rigs_are_one_object_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("rig.toml");
    let drive = folder.path().join("drive");
    let facts = object(&["rig", "new", text(&rig), "--lidar", "vlp16", "--lidar-position", "0,0,1.8"]);
    assert_eq!((&facts["lidar"], &facts["n_cameras"]), (&"vlp16".into(), &0.into()));
    let simulate = ["simulate", "--seed", "1", "--seconds", "2", "--rig", "survey", "--out", text(&drive)];
    assert!(replica(&simulate).status.success());
    let facts = object(&["rig", "check", text(&drive)]);
    let sensors = facts["sensors"].as_array().expect("a list");
    assert!(sensors.iter().any(|sensor| sensor["n"].as_u64() > Some(10) && sensor["first"].is_string()), "{facts}");
    let verdicts = facts["verdicts"].as_array().expect("a list");
    let n_doubts = verdicts.iter().filter(|verdict| verdict["answer"] == "doubt").count();
    assert!(verdicts.len() > 3 && facts["n_doubts"] == n_doubts, "{facts}");
    let facts = object(&["rig", "calibrate", text(&drive)]);
    let changes = facts["changes"].as_array().expect("a list");
    assert!(changes.iter().all(|change| change["subject"].is_string() && change["outcome"].is_string()), "{facts}");
    assert!(!changes.is_empty() && facts["written"] == serde_json::json!([]), "{facts}");
}

#[test]
fn geojson_and_json_exclude_each_other() {
    let output = replica(&["instances", "cloud.ply", "--json", "--geojson"]);
    assert_eq!(output.status.code(), Some(2));
}
