//! `replica deliver` on the results of a run.

use crate::finished_run::{FinishedRun, RunOptions, write_run};
use crate::support::{printed, replica, succeeded, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A run of two sweeps at the origin of its drive, with these doubts of export.
pub fn run_with_doubts(folder: &Path, doubts: &Value) -> (PathBuf, FinishedRun) {
    let drive = folder.join("drive");
    let run = folder.join("run");
    if !drive.exists() {
        let arguments = ["simulate", "--seed", "1", "--seconds", "0.25", "--rig", "survey", "--out", text(&drive)];
        succeeded(&replica(&arguments));
    }
    let written = write_run(&drive, &run, &RunOptions::default());
    let mut summary = serde_json::to_value(run::summary::Summary::default()).expect("encodes");
    let mut stage = serde_json::to_value(run::summary::StageSummary::default()).expect("encodes");
    stage["name"] = json!("export");
    stage["doubts"] = doubts.clone();
    summary["stages"] = json!([stage]);
    std::fs::write(run.join("summary.json"), summary.to_string()).expect("writes");
    (run, written)
}

#[test]
fn answer_as_json_has_the_facts_of_the_text() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let said = succeeded(&replica(&["deliver", text(&run), "--out", text(&out), "--semantic-kitti", "--json"]));
    let answer: Value = serde_json::from_str(&said).expect("one object and nothing else");
    assert_eq!((&answer["out"], &answer["epsg"]), (&json!(text(&out)), &json!(32_631)));
    assert_eq!(answer["n_points"], written.n_points);
    assert_eq!(answer["files"], facts(&out)["files"]);
    assert!(answer["path"].as_array().is_some_and(|files| files.contains(&json!("trajectory.csv"))), "{answer}");
    assert_eq!((&answer["rasters"], &answer["accuracy"]), (&json!([]), &Value::Null));
    assert_eq!(answer["semantic_kitti"]["n"], 3);
}

fn facts(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("delivery.json")).expect("was written")).expect("JSON")
}

pub fn names(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(out).expect("lists");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("lists").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn everything_is_written_in_utm_of_the_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let points = folder.path().join("points.csv");
    std::fs::write(&points, "name,x,y,z\nA,0,0,0\n").expect("writes");
    let said = succeeded(&replica(&[
        "deliver",
        text(&run),
        "--out",
        text(&out),
        "--copc",
        "--rasters",
        "--cloudcompare",
        "--semantic-kitti",
        "--check-points",
        text(&points),
    ]));
    assert!(said.contains("WGS 84 / UTM zone 31N (EPSG:32631), ellipsoidal height, m"), "{said}");
    let facts = facts(&out);
    assert_eq!((facts["epsg"].as_u64(), facts["n_points"].as_u64()), (Some(32_631), Some(written.n_points)));
    assert_eq!(facts["unreferenced"], Value::Null);
    let files = facts["files"].as_array().expect("a list");
    let in_tiles = files.iter().filter(|file| file["file"] != "points.copc.laz");
    assert_eq!(in_tiles.map(|file| file["n_points"].as_u64().expect("a count")).sum::<u64>(), written.n_points);
    let names = names(&out);
    for name in [
        "points.copc.laz",
        "trajectory.txt",
        "trajectory_kitti.txt",
        "trajectory.csv",
        "trajectory.geojson",
        "trajectory.sbet",
        "objects.csv",
        "objects.geojson",
        "terrain.tif",
        "height.tif",
        "color.tif",
        "class.tif",
        "check_points.csv",
        "cloudcompare",
        "sequences",
    ] {
        assert!(names.iter().any(|found| found == name), "{name} is not in {names:?}");
    }
    assert!(names.iter().all(|name| !name.starts_with('.')), "nothing unfinished: {names:?}");

    let again = replica(&["deliver", text(&run), "--out", text(&out)]);
    assert_eq!(again.status.code(), Some(2));
    assert!(printed(&again).contains("the folder must be empty"), "{}", printed(&again));
}

#[test]
fn run_without_determined_place_is_refused_or_written_in_local_coordinates() {
    let folder = tempfile::tempdir().expect("a folder");
    let text_of_doubt = "heading undetermined: standard deviation 12.0 degrees (limit 5), median 11.0";
    let doubts = json!([
        { "name": "heading_undetermined", "size": 12.0, "text": text_of_doubt },
        { "name": "lost_columns", "size": 0.5, "text": "columns were lost" }
    ]);
    let (run, _) = run_with_doubts(folder.path(), &doubts);
    let out = folder.path().join("out");
    let deliver = |more: &[&str]| replica(&[&["deliver", text(&run), "--out", text(&out)][..], more].concat());
    for crs in ["auto", "EPSG:2154"] {
        let refused = deliver(&["--crs", crs]);
        assert_eq!(refused.status.code(), Some(1), "{}", printed(&refused));
        let said = printed(&refused);
        assert!(said.contains(text_of_doubt) && said.contains("hint: --allow-unreferenced"), "{said}");
        assert!(!said.contains("columns were lost") && !out.exists(), "{said}");
    }
    let said = succeeded(&deliver(&["--allow-unreferenced"]));
    assert!(said.contains("warning: coordinates are local"), "{said}");
    assert_eq!((&facts(&out)["epsg"], facts(&out)["unreferenced"].as_str()), (&Value::Null, Some(text_of_doubt)));
    assert!(!names(&out).iter().any(|name| name.contains("geojson") || name.contains("sbet")), "{:?}", names(&out));

    // Without a place, local coordinates may be asked for.
    let local = folder.path().join("local");
    succeeded(&replica(&["deliver", text(&run), "--out", text(&local), "--crs", "local", "--las", "--tile-m", "0"]));
    assert!(names(&local).contains(&"points.las".to_owned()));
    std::fs::remove_file(run.join("georeference.json")).expect("removed");
    let nowhere = replica(&["deliver", text(&run), "--out", text(&folder.path().join("nowhere"))]);
    assert!(printed(&nowhere).contains("is not placed on the Earth"), "{}", printed(&nowhere));
    std::fs::remove_file(run.join("summary.json")).expect("removed");
    let unfinished = replica(&["deliver", text(&run), "--out", text(&folder.path().join("unfinished"))]);
    assert!(printed(&unfinished).contains("the run is not finished"), "{}", printed(&unfinished));
}

#[test]
fn wrong_arguments_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let grid = folder.path().join("grid.gtx");
    std::fs::write(&grid, "no grid").expect("writes");
    for (more, code, rule) in [
        (&["--crs", "EPSG:4326"][..], 2, "EPSG:4326 is not supported"),
        (&["--crs", "utm"], 2, "must be auto, local or EPSG:N"),
        (&["--crs", "local", "--geoid", text(&grid)], 2, "--geoid: needs a coordinate reference system"),
        (&["--geoid", text(&grid)], 1, "grid.gtx: is not a GTX grid: 7 bytes"),
        (&["--tile-m", "0.5"], 2, "must be a whole number, 0 to 100000"),
        (&["--cell-m", "0.5"], 2, "--rasters"),
        (&["--rasters", "--cell-m", "0"], 2, "must be 0.01 to 100"),
        (&["--system", "a name of more than thirty-two letters"], 2, "must be up to 32 ASCII characters"),
    ] {
        let refused = replica(&[&["deliver", text(&run), "--out", text(&out)][..], more].concat());
        assert_eq!(refused.status.code(), Some(code), "{more:?}: {}", printed(&refused));
        assert!(printed(&refused).contains(rule), "{more:?}: {}", printed(&refused));
        assert!(!out.exists(), "{more:?}");
    }
}
