//! Control and check points.

use crate::town_runs::{Pass, TownRun, errors, mean, submaps};
use adjustment::{ControlPoint, Submaps, adjust_survey};
use geometry::{Point3, Vector3};
use raytrace::Ray;
use surveying::check_points::{CheckPoint, PointUse};

const PASSES: [Pass; 2] = [
    Pass { town_seed: 43, pass: 0, off_m: [1.2, 0.7, -1.5], turned_rad: 0.003, sigma_m: 1.5 },
    Pass { town_seed: 43, pass: 1, off_m: [-0.8, -1.1, 0.9], turned_rad: -0.002, sigma_m: 1.5 },
];

/// Names of the drives, as `submaps` gives them.
const DRIVE: &str = "drive 0";

/// A mark at the position of a surface of submap `k`, which a surveyor has measured and picked in the cloud.
fn mark(runs: &[TownRun], submaps: &Submaps, k: usize, point_use: PointUse) -> ControlPoint {
    let submap = &submaps.all[k];
    let surface = submap.keyframe.surfaces().nth(100).expect("has surfaces");
    let picked = submap.survey_from_submap * surface.position;
    let p_in_survey = runs[submap.drive].true_poses[submap.seq as usize] * surface.position;
    let point = CheckPoint {
        name: format!("mark {k}"),
        in_cloud: Some(picked.coords.into()),
        drive: Some(DRIVE.to_owned()),
        point_use,
        ..CheckPoint::default()
    };
    ControlPoint { point, p_in_survey }
}

/// A height point on the road, below the path of submap `k`.
fn height_point(runs: &[TownRun], submaps: &Submaps, k: usize, point_use: PointUse) -> ControlPoint {
    let submap = &submaps.all[k];
    let run = &runs[submap.drive];
    let p_in_submap = Point3::from(submap.keyframe.submap_from_body.translation.vector);
    let above = run.true_poses[submap.seq as usize] * p_in_submap;
    let ray = Ray { origin: above.coords.cast(), direction: -Vector3::z(), seed: 0 };
    let hit = run.simulation.scene.cast(&run.simulation.scene.at(0.0), &ray, 10.0).expect("the road");
    let p_in_survey = above - Vector3::z() * f64::from(hit.range_m);
    ControlPoint { point: CheckPoint { name: format!("height {k}"), point_use, ..CheckPoint::default() }, p_in_survey }
}

#[test]
fn five_marks_place_both_drives_and_check_points_say_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let (runs, submaps) = submaps(folder.path(), &PASSES);
    let marks = [0, 2, 5, 7, 9].map(|k| mark(&runs, &submaps, k, PointUse::Control));
    let checks = [1, 4, 12, 16].map(|k| height_point(&runs, &submaps, k, PointUse::Check));
    let points: Vec<ControlPoint> = marks.into_iter().chain(checks).collect();
    let survey = adjust_survey(&submaps, &points).expect("is adjusted");
    assert!(survey.control.len() == 5 && survey.control.iter().all(|seen| seen.agrees));
    for (drive, errors) in errors(&runs, &submaps, &survey).iter().enumerate() {
        let off = mean(errors);
        assert!(off.xy().norm() < 0.03 && off.z.abs() < 0.04, "drive {drive} is off by {off} m");
    }
    assert!(survey.check.len() >= 4);
    let without = adjust_survey(&submaps, &points[..5]).expect("is adjusted");
    assert_eq!(survey.after, without.after, "a check point has moved the result");
    for seen in &survey.check {
        let up = seen.residual_m(&survey.after)[2].expect("is measured");
        assert!(up.abs() < 0.06, "{}: {up} m", points[seen.point].point.name);
    }
}

#[test]
fn height_points_lift_the_survey() {
    let folder = tempfile::tempdir().expect("a folder");
    let (runs, submaps) = submaps(folder.path(), &PASSES);
    let points: Vec<ControlPoint> =
        [1, 4, 8].map(|k| height_point(&runs, &submaps, k, PointUse::Control)).into_iter().collect();
    let survey = adjust_survey(&submaps, &points).expect("is adjusted");
    for errors in errors(&runs, &submaps, &survey) {
        let up = mean(&errors).z;
        assert!(up.abs() < 0.04, "{up} m");
    }
}

#[test]
fn wrong_mark_is_named_and_does_not_bend() {
    let folder = tempfile::tempdir().expect("a folder");
    let (runs, submaps) = submaps(folder.path(), &PASSES);
    let mut points = [0, 2, 5, 7, 9].map(|k| mark(&runs, &submaps, k, PointUse::Control)).to_vec();
    points[2].p_in_survey.x += 0.5;
    let survey = adjust_survey(&submaps, &points).expect("is adjusted");
    let agrees: Vec<bool> = survey.control.iter().map(|seen| seen.agrees).collect();
    assert_eq!(agrees, [true, true, false, true, true]);
    let off = mean(&errors(&runs, &submaps, &survey)[0]);
    assert!(off.norm() < 0.05, "{off} m");
    let residual = survey.control[2].measured.residual_m(&survey.after)[0].expect("is measured");
    assert!((residual + 0.5).abs() < 0.05, "{residual} m");
}
