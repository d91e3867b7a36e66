//! Rotation and time offset of the inertial unit, estimated by comparing its angular rates with the LiDAR's.

use super::{Change, Outcome, Refined, delayed, outcome};
use crate::check::{quaternion, rotation_of};
use crate::survey::Survey;
use drive::manifest::PoseEntry;
use geometry::{UnitQuaternion, Vector3};

/// Largest standard deviation of a determined rotation, rad: one degree.
const MAX_SIGMA: f64 = std::f64::consts::PI / 180.0;
/// Largest standard deviation of a determined time offset, s.
const MAX_LATE_SIGMA_S: f64 = 0.02;
const NAMES: [&str; 3] = ["rotation about x", "rotation about y", "rotation about z"];

pub(super) fn refine(survey: &Survey, refined: &mut Refined) {
    let (Some(check), Some(entry)) = (&survey.inertial, &mut refined.manifest.imu) else { return };
    let unknown = |quantity: &str, text: &str| Change {
        subject: "imu".to_owned(),
        quantity: quantity.to_owned(),
        difference: 0.0,
        sigma: 0.0,
        unit: "degrees",
        outcome: Outcome::NotObservable,
        text: text.to_owned(),
    };
    if let Some(reason) = check.why_withheld() {
        refined.changes.push(unknown("rotation", reason));
        return;
    }
    let Some(found) = check.mounting().filter(|_| check.is_verified()) else {
        refined.changes.push(unknown("rotation", "the vehicle turned or braked too little"));
        return;
    };
    let correction = check.correction();
    let mut rotation = Vector3::zeros();
    for axis in 0..3 {
        let difference = found.rotation[axis];
        let sigma = found.rotation_sigma[axis];
        if sigma > MAX_SIGMA {
            let text = format!(
                "deviation {:.1} degrees: the vehicle turned too little about the other axes",
                sigma.to_degrees()
            );
            refined.changes.push(unknown(NAMES[axis], &text));
            continue;
        }
        let outcome = outcome(difference, sigma);
        if outcome == Outcome::Replaced {
            rotation[axis] = difference;
        }
        let difference = difference.to_degrees();
        let sigma = sigma.to_degrees();
        refined.changes.push(Change { difference, sigma, outcome, ..unknown(NAMES[axis], "") });
    }
    let axes = correction.rate.axes;
    let is_turned = rotation != Vector3::zeros() || axes != registration::Axes::BODY;
    if is_turned && axes.matrix().determinant() > 0.0 {
        let given = entry.mounting();
        let new = UnitQuaternion::from_scaled_axis(rotation) * rotation_of(axes.matrix()) * given.rotation;
        let text = format!("body_from_imu.rotation {} instead of {}", quaternion(&new), quaternion(&given.rotation));
        let mounting = geometry::Pose::from_parts(given.translation, new);
        entry.position_in_body = [0.0; 3];
        entry.body_from_imu = Some(PoseEntry::from(mounting));
        let total = UnitQuaternion::angle_to(&new, &given.rotation).to_degrees();
        let sigma = found.rotation_sigma.norm().to_degrees();
        refined.changes.push(Change {
            difference: total,
            sigma,
            outcome: Outcome::Replaced,
            ..unknown("rotation", &text)
        });
    }
    refined.changes.push(unknown("position", "only rotations are measured"));
    let late_ms = found.late_s * 1e3;
    let sigma_ms = found.late_sigma_s * 1e3;
    refined.changes.push(if found.late_sigma_s > MAX_LATE_SIGMA_S {
        let text = format!("deviation {sigma_ms:.0} ms: the vehicle turned too little");
        Change { unit: "ms", ..unknown("delay", &text) }
    } else {
        let new = delayed(entry.delay_nanos, found.late_s);
        let new = new.filter(|_| outcome(late_ms, sigma_ms) == Outcome::Replaced);
        let (outcome, text) = match new {
            Some(new) => (Outcome::Replaced, format!("delay_nanos {new} instead of {}", entry.delay_nanos)),
            None => (Outcome::Kept, String::new()),
        };
        entry.delay_nanos = new.unwrap_or(entry.delay_nanos);
        Change { difference: late_ms, sigma: sigma_ms, unit: "ms", outcome, ..unknown("delay", &text) }
    });
}
