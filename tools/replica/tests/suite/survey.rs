//! `replica survey`, and the delivery of its result.

use crate::deliver::run_with_doubts;
use crate::finished_run::{RunOptions, write_run};
use crate::support::{printed, replica, succeeded, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use surveying::crs::Crs;
use surveying::{RunFolder, TargetFrame};

/// Two runs of one drive; the second one is 3 m to the east and 2 m up. Returns the folder's survey.toml.
fn two_runs(folder: &Path) -> PathBuf {
    let (first, _) = run_with_doubts(folder, &json!([]));
    let second = folder.join("second");
    write_run(&folder.join("drive"), &second, &RunOptions { off_m: [3.0, 2.0], ..RunOptions::default() });
    std::fs::copy(first.join("summary.json"), second.join("summary.json")).expect("copies");
    let survey = folder.join("survey.toml");
    let drives = "version = 1\n[[drives]]\nrun = \"run\"\n[[drives]]\nrun = \"second\"\nname = \"again\"\n";
    std::fs::write(&survey, drives).expect("writes");
    survey
}

fn json_file(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("was written")).expect("JSON")
}

#[test]
fn runs_apart_become_one_delivery() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = two_runs(folder.path());
    let out = folder.path().join("survey");
    let said = succeeded(&replica(&["survey", text(&survey), "--out", text(&out), "--json"]));
    let answer: Value = serde_json::from_str(&said).expect("one object");
    let pair = &answer["pairs"][0];
    assert_eq!((&pair["drives"], &pair["n_refused"]), (&json!(["run", "again"]), &json!(0)));
    let metres = |value: &Value| [0, 1].map(|axis| value[axis].as_f64().expect("a number"));
    let [before, after] = [metres(&pair["before_m"]), metres(&pair["after_m"])];
    assert!((before[0] - 3.0).abs() < 0.02 && (before[1] - 2.0).abs() < 0.02, "{before:?}");
    assert!(after[0] < 0.01 && after[1] < 0.01, "{after:?}");

    let delivery = folder.path().join("delivery");
    let arguments = ["deliver", text(&out), "--out", text(&delivery), "--crs", "local", "--tile-m", "0", "--rasters"];
    succeeded(&replica(&arguments));
    assert!(delivery.join("difference.tif").exists());
    let facts = json_file(&delivery.join("delivery.json"));
    let points = |run: &str| json_file(&folder.path().join(run).join("clouds/index.json"))["n_points"].as_u64();
    assert_eq!(facts["n_points"].as_u64(), Some(points("run").expect("counted") + points("second").expect("counted")));
    let refused = printed(&replica(&["view", text(&out)]));
    assert!(refused.contains("is a survey, it has survey.json") && refused.contains("points.copc.laz"), "{refused}");
    let height = |z: usize| facts["files"][0]["bounds"][z][2].as_f64().expect("a number");
    let own = json_file(&folder.path().join("run/clouds/index.json"));
    let lowest =
        own["clouds"].as_array().expect("clouds").iter().map(|cloud| cloud["bounds"][0][2].as_f64().expect("one"));
    let lowest = lowest.fold(f64::INFINITY, f64::min);
    // The two drives meet between their heights, by their equal deviations.
    assert!((height(0) - lowest - 1.0).abs() < 0.1, "{} and {lowest}", height(0));
    for drive in ["run", "again"] {
        assert!(
            delivery.join(drive).join("trajectory.sbet").exists()
                || delivery.join(drive).join("trajectory.csv").exists()
        );
    }
}

#[test]
fn run_that_changed_after_the_survey_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = two_runs(folder.path());
    let out = folder.path().join("survey");
    succeeded(&replica(&["survey", text(&survey), "--out", text(&out)]));
    let index = folder.path().join("second/clouds/index.json");
    let mut changed = json_file(&index);
    changed["clouds"][0]["translation"][0] = json!(17.5);
    std::fs::write(&index, changed.to_string()).expect("writes");
    let refused = replica(&["deliver", text(&out), "--out", text(&folder.path().join("delivery"))]);
    let said = printed(&refused);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("submap 0 of drive \"again\" has another pose") && said.contains("adjust the survey again"),
        "{said}"
    );
}

#[test]
fn wrong_survey_files_are_refused_with_the_rule() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = two_runs(folder.path());
    std::fs::write(
        folder.path().join("points.csv"),
        "name,x,y,z,use,drive,cloud_x,cloud_y,cloud_z\nA,1,2,3,control,third,1,2,3\n",
    )
    .expect("writes");
    let drives = "[[drives]]\nrun = \"run\"\n";
    for (content, rule) in [
        (String::from("version = 2\n") + drives, "version 2; must be 1"),
        (String::from("version = 1\ndrives = []\n"), "has no [[drives]]"),
        (format!("version = 1\nspeed = 3\n{drives}"), "unknown field `speed`"),
        (format!("version = 1\n{drives}{drives}"), "two drives are named \"run\""),
        (String::from("version = 1\n[[drives]]\nrun = \"drive\"\n"), "is a drive, it has drive.toml"),
        (format!("version = 1\n{drives}name = \"a/b\"\n"), "must not be empty, begin with a dot or contain slashes"),
        (
            format!("version = 1\n{drives}[points]\nfile = \"points.csv\"\ncrs = \"utm\"\n"),
            "points.crs: \"utm\" must be EPSG:N",
        ),
        (
            format!("version = 1\n{drives}[points]\nfile = \"points.csv\"\ncrs = \"EPSG:32631\"\n"),
            "point \"A\": drive \"third\" must be one of run",
        ),
    ] {
        std::fs::write(&survey, &content).expect("writes");
        let refused = replica(&["survey", text(&survey), "--out", text(&folder.path().join("out"))]);
        let said = printed(&refused);
        assert!(!refused.status.success() && said.contains(rule), "{content}\n{said}");
        assert!(!folder.path().join("out/survey.json").exists());
    }
}

#[test]
fn control_point_outside_of_all_drives_is_a_doubt() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = two_runs(folder.path());
    std::fs::write(folder.path().join("points.csv"), "name,x,y,z,use\nfar,452000,5420000,50,control\n")
        .expect("writes");
    let content = std::fs::read_to_string(&survey).expect("reads");
    std::fs::write(&survey, content + "[points]\nfile = \"points.csv\"\ncrs = \"EPSG:32631\"\n").expect("writes");
    let out = folder.path().join("survey");
    let doubted = replica(&["survey", text(&survey), "--out", text(&out)]);
    assert_eq!(doubted.status.code(), Some(3), "{}", printed(&doubted));
    assert!(printed(&doubted).contains("control point \"far\" is in no submap"), "{}", printed(&doubted));
}

#[test]
fn survey_and_delivery_report_the_same_accuracy_at_a_picked_mark() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = two_runs(folder.path());
    let run = RunFolder::open(&folder.path().join("second")).expect("opens");
    let mut picked = None;
    run.each_point(&run.index.clouds[0], |point| picked = picked.or(Some(point.xyz))).expect("reads");
    let [px, py, pz] = picked.expect("has points");
    // The drives meet in the middle; the mark is 4 cm farther east and 3 cm lower than measured.
    let georeference = run.georeference.as_ref().expect("is placed");
    let frame = TargetFrame::projected(georeference, Crs::from_epsg(32631).expect("known")).expect("a frame");
    let [x, y, z] = frame.from_cloud([px - 1.5 - 0.04, py, pz - 1.0 + 0.03]).expect("converts");
    let row = format!("M,{x},{y},{z},check,again,{px},{py},{pz}\n");
    let points = folder.path().join("points.csv");
    std::fs::write(&points, format!("name,x,y,z,use,drive,cloud_x,cloud_y,cloud_z\n{row}")).expect("writes");
    let content = std::fs::read_to_string(&survey).expect("reads");
    std::fs::write(&survey, content + "[points]\nfile = \"points.csv\"\ncrs = \"EPSG:32631\"\n").expect("writes");
    let out = folder.path().join("survey");
    let said = succeeded(&replica(&["survey", text(&survey), "--out", text(&out), "--json"]));
    let surveyed: Value = serde_json::from_str(&said).expect("one object");
    let delivery = folder.path().join("delivery");
    let arguments = ["--crs", "EPSG:32631", "--tile-m", "0", "--check-points", text(&points), "--json"];
    let said =
        succeeded(&replica(&[["deliver", text(&out), "--out", text(&delivery)].as_slice(), &arguments].concat()));
    let delivered: Value = serde_json::from_str(&said).expect("one object");

    let accuracy = &surveyed["check"]["accuracy"];
    assert_eq!(accuracy, &json_file(&out.join("survey.json"))["accuracy"]["check"]);
    for (axis, off_m) in [0.04, 0.0, -0.03].into_iter().enumerate() {
        let mean = |accuracy: &Value| accuracy["axes"][axis]["mean_m"].as_f64().expect("a number");
        let [by_survey, by_delivery] = [mean(accuracy), mean(&delivered["accuracy"])];
        assert!((by_survey - off_m).abs() < 0.02, "{axis}: {by_survey}");
        assert!((by_survey - by_delivery).abs() < 2e-3, "{axis}: {by_survey} and {by_delivery}");
    }
    for class in [&accuracy["horizontal_class"], &delivered["accuracy"]["vertical_class"]] {
        assert_eq!((&class["n"], &class["n_missing"]), (&json!(1), &json!(29)), "{class}");
    }
    let heights = &surveyed["heights"][0];
    assert!(
        heights["rmsd_m"].as_f64().expect("a number") < 0.01 && heights["is_within_class"] == json!(true),
        "{heights}"
    );
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect("was written");
    assert!(
        read("accuracy.csv").contains("class_v,1,") && read("accuracy.csv").contains("rmsd_z,"),
        "{}",
        read("accuracy.csv")
    );
    assert!(read("residuals.csv").contains("\nM,check,,1,0.0"), "{}", read("residuals.csv"));
    assert!(delivery.join("check_points_summary.csv").exists());
}
