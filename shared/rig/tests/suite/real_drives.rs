//! Rigs of third-party drives.

use crate::support::turn;
use drive::manifest::{LidarEntry, Manifest, PoseEntry};
use drive::{Drive, MANIFEST_FILE};
use geometry::{Pose, Translation3, Vector3};
use registration::SpinDirection;
use rig::check::Report;
use rig::refine::{Outcome, Refined};
use rig::survey::{Survey, SurveySettings};
use std::os::unix::fs::symlink;
use tempfile::TempDir;

/// KITTI raw: 22 sweeps of an HDL-64E on a car that drives straight, without point times.
const STREET: &str = "kitti_raw_0048";
/// Published height of the LiDAR of KITTI above the ground, m.
const LIDAR_HEIGHT_M: f64 = 1.73;

/// The street with the origin of the body on the ground, and the LiDAR rotated by `degrees` about an axis of the body.
fn street(axis: Vector3<f64>, degrees: f64) -> (TempDir, Drive) {
    let folder = tempfile::tempdir().expect("a folder");
    symlink(real_data::path(STREET), folder.path().join("lidar")).expect("links");
    let mounted = Pose::from_parts(Translation3::new(0.0, 0.0, LIDAR_HEIGHT_M), Pose::identity().rotation);
    let mut mounting = PoseEntry::from(mounted);
    turn(&mut mounting, axis, degrees, true);
    let manifest = Manifest::with_lidar("a street", LidarEntry::new("hdl64e", "pcd", "lidar", mounting));
    std::fs::write(folder.path().join(MANIFEST_FILE), toml::to_string(&manifest).expect("TOML")).expect("writes");
    let drive = Drive::open(folder.path()).expect("a drive");
    (folder, drive)
}

/// Doubts, and all verdicts as text.
fn checked(drive: &Drive, untimed_turn: Option<SpinDirection>) -> (Vec<String>, String) {
    let settings = SurveySettings { untimed_turn, ..SurveySettings::default() };
    let survey = Survey::from_drive(drive, &settings).expect("surveyed");
    let report = Report::from_survey(drive, &survey, &settings).expect("checked");
    let doubts = report.doubts().map(|verdict| format!("{} {}", verdict.subject, verdict.check));
    let lines: Vec<String> = report.verdicts.iter().map(ToString::to_string).collect();
    (doubts.collect(), lines.join("\n"))
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn real_street_fits_its_published_mounting_but_for_the_missing_times() {
    let (_folder, drive) = street(Vector3::z(), 0.0);
    let (doubts, text) = checked(&drive, None);
    assert_eq!(doubts, ["lidar spin"]);
    assert!(text.contains("set [slam_aggregate] untimed_turn = \"clockwise\""), "{text}");
    let (doubts, text) = checked(&drive, Some(SpinDirection::Clockwise));
    assert_eq!(doubts, [""; 0], "{text}");
    let origin = text.split_once("the origin of the body ").and_then(|(_, rest)| rest.split_once(" m"));
    let height_m: f64 = origin.expect("is measured").0.parse().expect("a number");
    assert!(height_m.abs() < 0.05, "{text}");
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn wrong_mountings_of_the_lidar_of_a_real_street_are_found() {
    for (axis, degrees, doubt) in [
        (Vector3::y(), 6.0, "lidar level"),
        (Vector3::z(), 8.0, "lidar heading"),
        (Vector3::z(), -90.0, "lidar heading"),
    ] {
        let (_folder, drive) = street(axis, degrees);
        let (doubts, text) = checked(&drive, Some(SpinDirection::Clockwise));
        assert_eq!(doubts, [doubt], "{text}");
    }
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn refined_rig_of_a_real_street_keeps_what_it_does_not_show() {
    let (_folder, drive) = street(Vector3::z(), 0.0);
    let settings = SurveySettings { untimed_turn: Some(SpinDirection::Clockwise), ..SurveySettings::default() };
    let survey = Survey::from_drive(&drive, &settings).expect("surveyed");
    let refined = Refined::from_survey(&drive, &survey, &settings).expect("refined");
    assert!(!refined.changes.is_empty());
    assert!(refined.changes.iter().all(|change| change.subject == "lidar"), "{:?}", refined.changes);
    let is_moved =
        |change: &&rig::refine::Change| change.outcome != Outcome::NotObservable && change.difference.abs() > 0.5;
    assert_eq!(refined.changes.iter().find(is_moved), None, "no ring of a sold unit errs by half a degree");
}
