//! Drives without control points.

use crate::town_runs::{Pass, errors, mean, submaps};
use adjustment::adjust_survey;

const FIRST: Pass = Pass { town_seed: 41, pass: 0, off_m: [0.3, -0.2, 0.4], turned_rad: 0.001, sigma_m: 0.5 };
const BACK: Pass = Pass { town_seed: 41, pass: 1, off_m: [-6.0, 4.5, 3.0], turned_rad: -0.006, sigma_m: 5.0 };

#[test]
fn drives_metres_apart_in_opposite_lanes_become_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let (runs, submaps) = submaps(folder.path(), &[FIRST, BACK]);
    let survey = adjust_survey(&submaps, &[]).expect("is adjusted");
    assert!(survey.matches.len() >= 12 && survey.matches.iter().all(|found| found.agrees), "{}", survey.matches.len());
    let errors = errors(&runs, &submaps, &survey);
    let apart = mean(&errors[0]) - mean(&errors[1]);
    assert!(apart.norm() < 0.02, "the drives are {apart} m apart");
    // The drive with the smaller stated deviation moves less.
    let moved = mean(&errors[0]) - geometry::Vector3::from(FIRST.off_m);
    assert!(moved.norm() < 0.3, "the accurate drive moved by {moved} m");
}

#[test]
fn number_of_threads_does_not_change_the_result() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, submaps) = submaps(folder.path(), &[FIRST, BACK]);
    let [one, many] = [1, 4].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
        pool.install(|| adjust_survey(&submaps, &[]).expect("is adjusted"))
    });
    assert_eq!(one.after, many.after);
    assert_eq!(one.matches, many.matches);
}

#[test]
fn drive_of_another_street_is_not_bent() {
    let folder = tempfile::tempdir().expect("a folder");
    let elsewhere = Pass { town_seed: 52, ..BACK };
    let (_, submaps) = submaps(folder.path(), &[FIRST, elsewhere]);
    let survey = adjust_survey(&submaps, &[]).expect("is adjusted");
    assert!(survey.matches.iter().all(|found| !found.agrees), "{} matches", survey.matches.len());
    for (before, after) in survey.before.iter().zip(&survey.after) {
        let moved = (before.translation.vector - after.translation.vector).norm();
        assert!(moved < 1e-3, "a submap moved by {moved} m");
    }
}

#[test]
fn submaps_of_one_drive_do_not_average_its_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, submaps) = submaps(folder.path(), &[FIRST]);
    let survey = adjust_survey(&submaps, &[]).expect("is adjusted");
    for [horizontal, up] in survey.sigma_m {
        assert!(horizontal > 0.45 && up > 0.45, "{horizontal} and {up} m are stated, a submap has 0.5 m");
    }
}
