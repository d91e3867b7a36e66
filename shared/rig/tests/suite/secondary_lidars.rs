//! The mounting of a second LiDAR: an upright HDL-32E in front, a tilted VLP-16 at the rear.

use crate::support::{Copied, turn, with_two_lidars};
use geometry::{Pose, Vector3};
use rig::check::Report;
use rig::refine::{Outcome, Refined};
use rig::survey::{Survey, SurveySettings};

fn copied() -> Copied {
    Copied::from_recorded(with_two_lidars())
}

fn mounting(manifest: &drive::manifest::Manifest) -> Pose {
    manifest.other_lidars[0].body_from_lidar.to_pose().expect("a pose")
}

/// Moves the stated mounting of the second LiDAR.
fn moved(degrees: f64, shift_m: [f64; 3]) -> Copied {
    let mut copied = copied();
    let entry = &mut copied.manifest.other_lidars[0].body_from_lidar;
    turn(entry, Vector3::new(0.3, -0.5, 0.8).normalize(), degrees, false);
    for (value, shift) in entry.translation.iter_mut().zip(shift_m) {
        *value += shift;
    }
    copied
}

fn verdict_of_rear(copied: &Copied) -> (bool, String) {
    let drive = copied.open();
    let settings = SurveySettings::default();
    let survey = Survey::from_drive(&drive, &settings).expect("surveyed");
    let report = Report::from_survey(&drive, &survey, &settings).expect("checked");
    let rear = report.verdicts.iter().find(|verdict| verdict.subject == "rear").expect("is judged");
    (rear.is_doubt(), rear.to_string())
}

#[test]
fn right_mounting_of_second_lidar_has_no_doubt() {
    let (is_doubt, text) = verdict_of_rear(&copied());
    assert!(!is_doubt && text.starts_with("fits"), "{text}");
}

#[test]
fn wrong_mounting_of_second_lidar_is_a_doubt() {
    for (degrees, shift_m) in [(2.0, [0.0; 3]), (0.0, [0.0, 0.25, 0.0]), (5.0, [0.1, -0.1, 0.1])] {
        let (is_doubt, text) = verdict_of_rear(&moved(degrees, shift_m));
        assert!(is_doubt && text.contains("lidar[1].body_from_lidar"), "{degrees} {shift_m:?}: {text}");
    }
}

#[test]
fn refined_mounting_of_second_lidar_is_the_true_one_within_its_deviations() {
    let truth = mounting(&with_two_lidars().manifest());
    for (degrees, shift_m) in [(0.0, [0.0; 3]), (1.5, [0.08, -0.06, 0.1]), (4.0, [-0.15, 0.2, 0.1])] {
        let copied = moved(degrees, shift_m);
        let before = mounting(&copied.manifest);
        let drive = copied.open();
        let settings = SurveySettings::default();
        let survey = Survey::from_drive(&drive, &settings).expect("surveyed");
        let found = Refined::from_survey(&drive, &survey, &settings).expect("refined");
        let changes: Vec<_> = found.changes.iter().filter(|change| change.subject == "rear").collect();
        assert_eq!(changes.len(), 6, "{changes:?}");
        let after = mounting(&found.manifest);
        let off = |pose: &Pose| {
            let shift = (pose.translation.vector - truth.translation.vector).norm();
            [shift, pose.rotation.angle_to(&truth.rotation).to_degrees()]
        };
        let [shift_before, turn_before] = off(&before);
        let [shift_after, turn_after] = off(&after);
        assert!(shift_after < 0.05 && turn_after < 0.2, "{degrees} {shift_m:?}: {shift_after} m {turn_after} degrees");
        assert!(shift_after < shift_before.max(0.03) && turn_after < turn_before.max(0.1));
        let is_sure = |outcome: Outcome| matches!(outcome, Outcome::Replaced | Outcome::Kept);
        assert!(changes.iter().filter(|change| is_sure(change.outcome)).count() >= 5, "{changes:?}");
    }
}
