//! Rotations and the common delay of the cameras, estimated from the outlines of objects.

use super::{Change, Outcome, Refined, delayed, outcome};
use crate::check::{CameraScores, turned};
use crate::survey::Survey;
use drive::Drive;
use drive::manifest::{CameraEntry, MosaicEntry, PoseEntry};
use geometry::{Pose, UnitQuaternion, Vector3};

const NAMES: [&str; 3] = ["rotation about x", "rotation about y", "rotation about z"];

pub(super) fn refine(drive: &Drive, survey: &Survey, refined: &mut Refined) {
    color_cameras(drive, survey, refined);
    let mosaic = |entry: &MosaicEntry| Change {
        subject: entry.name.clone(),
        quantity: "rotation and delay".to_owned(),
        difference: 0.0,
        sigma: 0.0,
        unit: "mrad",
        outcome: Outcome::NotObservable,
        text: "outlines are compared with color images only".to_owned(),
    };
    refined.changes.extend(drive.manifest().mosaics.iter().map(mosaic));
}

fn color_cameras(drive: &Drive, survey: &Survey, refined: &mut Refined) {
    let n_cameras = drive.rig().cameras.len();
    if n_cameras == 0 {
        return;
    }
    let scores = CameraScores::from_survey(drive, survey, &vec![true; n_cameras]);
    for (camera, found) in scores.offset.cameras.iter().enumerate() {
        let name = drive.manifest().cameras[camera].name.clone();
        let unknown = |quantity: &str, text: String| Change {
            subject: name.clone(),
            quantity: quantity.to_owned(),
            difference: 0.0,
            sigma: 0.0,
            unit: "mrad",
            outcome: Outcome::NotObservable,
            text,
        };
        if !found.is_observable() {
            let text = format!("{} outlines, peak {:.1}", found.n_edges, found.peak);
            refined.changes.push(unknown("rotation", text));
            continue;
        }
        let [rotation, sigma] = [found.rotation, found.deviation].map(|values| values.map(f64::from));
        let mut correction = Vector3::zeros();
        for axis in 0..3 {
            // An axis that was not fitted has no standard deviation.
            if sigma[axis] == 0.0 {
                let text = if axis == 2 { "below half a degree" } else { "along the outlines" };
                refined.changes.push(unknown(NAMES[axis], text.to_owned()));
                continue;
            }
            let outcome = outcome(rotation[axis], sigma[axis]);
            if outcome == Outcome::Replaced {
                correction[axis] = rotation[axis];
            }
            refined.changes.push(Change {
                outcome,
                difference: rotation[axis] * 1e3,
                sigma: sigma[axis] * 1e3,
                ..unknown(NAMES[axis], String::new())
            });
        }
        refined.changes.push(unknown("position", "only rotations are measured".to_owned()));
        if correction != Vector3::zeros() {
            let given = drive.rig().cameras[camera].body_from_camera;
            // The points move by the rotation in the camera frame.
            let new: Pose = turned(&given, &UnitQuaternion::from_scaled_axis(correction).inverse());
            refined.manifest.cameras[camera].body_from_camera = PoseEntry::from(new);
        }
    }
    let delay = Change {
        subject: "cameras".to_owned(),
        quantity: "delay".to_owned(),
        difference: 0.0,
        sigma: 0.0,
        unit: "ms",
        outcome: Outcome::NotObservable,
        text: "outlines move too little across the images".to_owned(),
    };
    refined.changes.push(match scores.offset.delay_s.map(|values| values.map(|value| f64::from(value) * 1e3)) {
        Some([difference, sigma]) => {
            let outcome = delay_all(&mut refined.manifest.cameras, difference, sigma);
            let text = "exposures after their stamps: subtracted from delay_nanos of all cameras".to_owned();
            Change { difference, sigma, outcome, text, ..delay }
        }
        None if scores.offset.is_delay_observable => {
            Change { outcome: Outcome::Kept, sigma: 3.0, text: "none found".to_owned(), ..delay }
        }
        None => delay,
    });
}

/// Changes the delay of all cameras if their exposures are significantly after their stamps: such stamps are early.
fn delay_all(cameras: &mut [CameraEntry], after_ms: f64, sigma_ms: f64) -> Outcome {
    let new: Option<Vec<i64>> = cameras.iter().map(|entry| delayed(entry.delay_nanos, -after_ms * 1e-3)).collect();
    match (outcome(after_ms, sigma_ms), new) {
        (Outcome::Replaced, Some(new)) => {
            cameras.iter_mut().zip(new).for_each(|(entry, delay_nanos)| entry.delay_nanos = delay_nanos);
            Outcome::Replaced
        }
        _ => Outcome::Kept,
    }
}
