//! `--json`: one JSON object on stdout, with the facts of the text.

use crate::support::{replica_lab, text};
use serde_json::Value;
use std::path::Path;

/// The object that a command prints on stdout, and nothing else.
fn object(arguments: &[&str]) -> Value {
    let output = replica_lab(&[arguments, &["--json"]].concat());
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
fn scores_are_one_object_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let cloud = folder.path().join("cloud.ply");
    write_cloud(&cloud);
    let scores = object(&["evaluate", "instances", text(&cloud), text(&cloud), "--min-points", "1"]);
    assert_eq!((&scores["classes"][0]["true"], &scores["classes"][0]["found"]), (&2.into(), &2.into()));
    let map = object(&["evaluate", "map", text(&cloud)]);
    assert_eq!(map["clouds"][0]["points"], 8);
}
