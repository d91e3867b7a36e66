//! The mounting of the LiDAR from two passes of one street in opposite directions, along their true paths.

use crate::support::{Copied, Recorded};
use drive::Drive;
use drive::manifest::{TrajectoryEntry, TrajectoryFormat};
use geometry::{Pose, UnitQuaternion, Vector3};
use rig::refine::{Change, Outcome, Refined};
use rig::survey::{Survey, SurveySettings};
use simulation::{DriveSpec, RigSpec};
use std::sync::OnceLock;

/// Stated deviations of the paths, m and degrees.
const PATH_M: f64 = 0.02;
const PATH_DEG: f64 = 0.005;

/// Two passes in opposite lanes.
fn passes() -> &'static [Recorded; 2] {
    static DRIVES: OnceLock<[Recorded; 2]> = OnceLock::new();
    DRIVES.get_or_init(|| {
        [0, 1].map(|pass| {
            let rig = RigSpec::built_in("survey").expect("built in");
            Recorded::simulate(&DriveSpec { rig, pass, ..DriveSpec::urban(21, 12.0).sparse(2) })
        })
    })
}

/// Offset of the path of the second pass, m.
const OFFSET_M: [f64; 3] = [0.02, -0.02, 0.01];

/// A pass whose given path is the true one with an offset. The stated mounting is turned about axes of the body.
fn turned(number: usize, turn_deg: [f64; 3]) -> Copied {
    let mut copied = Copied::from_recorded(&passes()[number]);
    let truth = copied.manifest.truth.as_ref().expect("has the truth").trajectory.clone();
    let text = std::fs::read_to_string(copied.path().join(truth)).expect("reads");
    let off_m = if number == 0 { [0.0; 3] } else { OFFSET_M };
    let mut moved = String::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        for (word, off) in words[1..4].iter_mut().zip(off_m) {
            *word = (word.parse::<f64>().expect("a number") + off).to_string();
        }
        moved += &(words.join(" ") + "\n");
    }
    std::fs::write(copied.path().join("path.txt"), moved).expect("writes");
    let mut entry = TrajectoryEntry::new("path.txt", TrajectoryFormat::Tum);
    entry.frame = Some("local".to_owned());
    entry.origin = copied.manifest.gnss.as_ref().map(|gnss| gnss.origin);
    entry.deviation_m = Some([PATH_M; 3]);
    entry.deviation_deg = Some([PATH_DEG; 3]);
    copied.manifest.trajectory = Some(entry);
    let entry = &mut copied.manifest.lidar.body_from_lidar;
    let pose = entry.to_pose().expect("a pose");
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn_deg).map(f64::to_radians)) * pose.rotation;
    *entry = Pose::from_parts(pose.translation, rotation).into();
    copied
}

fn refined(drives: &[Drive]) -> Result<Refined, rig::error::RigError> {
    let settings = SurveySettings { seconds: 30.0, ..SurveySettings::default() };
    let survey = Survey::from_drive(&drives[0], &settings).expect("surveyed");
    let mut refined = Refined::from_survey(&drives[0], &survey, &settings)?;
    refined.changes.clear();
    refined.add_boresight(&drives[0], &drives[1..], &settings)?;
    Ok(refined)
}

fn change<'a>(refined: &'a Refined, quantity: &str) -> &'a Change {
    let found = refined.changes.iter().find(|change| change.quantity.starts_with(quantity));
    found.unwrap_or_else(|| panic!("{quantity}: {:?}", refined.changes))
}

#[test]
fn turned_lidar_is_found_by_two_passes_in_opposite_directions() {
    let turns = [0.3, -0.3, 0.3];
    let copied = [0, 1].map(|pass| turned(pass, turns));
    let drives = copied.each_ref().map(Copied::open);
    let found = refined(&drives).expect("refined");
    for change in &found.changes {
        println!("{change}");
    }
    for (quantity, turn) in ["roll", "pitch", "heading"].into_iter().zip(turns) {
        let change = change(&found, quantity);
        assert_eq!(change.outcome, Outcome::Replaced, "{change}");
        let error = change.difference + turn;
        assert!(error.abs() < 0.03 && error.abs() < 4.0 * change.sigma, "{change}: {error} degrees off");
    }
    // All passes are shifted alike.
    assert_eq!(change(&found, "position along z").outcome, Outcome::NotObservable);
    let truth = passes()[0].manifest().lidar.body_from_lidar.to_pose().expect("a pose");
    let after = found.manifest.lidar.body_from_lidar.to_pose().expect("a pose");
    assert!(after.rotation.angle_to(&truth.rotation).to_degrees() < 0.05);
}

#[test]
fn right_mounting_is_kept() {
    let copied = [0, 1].map(|pass| turned(pass, [0.0; 3]));
    let found = refined(&copied.each_ref().map(Copied::open)).expect("refined");
    for change in &found.changes {
        println!("{change}");
        assert!(change.outcome != Outcome::Replaced || change.difference.abs() < 0.02, "{change}");
    }
}

#[test]
fn single_pass_of_a_tilted_lidar_determines_nothing() {
    let found = refined(&[turned(0, [0.3, 0.3, 0.0]).open()]).expect("refined");
    let [change] = &found.changes[..] else { panic!("{:?}", found.changes) };
    assert_eq!(change.outcome, Outcome::NotObservable);
    assert!(change.text.contains("hardly any surface is seen in several passes"), "{change}");
    assert!(!found.has_changes());
}

#[test]
fn pass_without_a_path_or_with_another_mounting_is_refused() {
    let first = turned(0, [0.0; 3]);
    let other = turned(1, [0.0, 0.2, 0.0]);
    let error = refined(&[first.open(), other.open()]).expect_err("is refused").to_string();
    assert!(error.contains("body_from_lidar differs from"), "{error}");
    let mut without = turned(1, [0.0; 3]);
    without.manifest.trajectory = None;
    let error = refined(&[first.open(), without.open()]).expect_err("is refused").to_string();
    assert!(error.contains("has no [trajectory]"), "{error}");
}
