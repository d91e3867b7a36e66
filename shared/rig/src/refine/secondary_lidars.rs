//! Mountings of the secondary LiDARs.

use super::{Change, Outcome, Refined, outcome};
use crate::error::RigError;
use crate::secondary_lidar::SecondaryMounting;
use crate::survey::{Survey, SurveySettings};
use drive::Drive;
use geometry::{Isometry3, UnitQuaternion, Vector3};

const AXES: [&str; 3] = ["x", "y", "z"];

pub(super) fn refine(
    drive: &Drive,
    survey: &Survey,
    settings: &SurveySettings,
    refined: &mut Refined,
) -> Result<(), RigError> {
    for (index, stated) in (1..).zip(&drive.rig().body_from_other_lidars) {
        let subject = drive.manifest().lidar_name(index).into_owned();
        let Some(found) = SecondaryMounting::measure(drive, survey, settings, index)? else {
            refined.changes.push(Change {
                subject,
                quantity: "mounting".to_owned(),
                difference: 0.0,
                sigma: 0.0,
                unit: "m",
                outcome: Outcome::NotObservable,
                text: "no data, or hardly any surface in common with the first LiDAR".to_owned(),
            });
            continue;
        };
        let mut kept = [0.0; 6];
        for (i, kept) in kept.iter_mut().enumerate() {
            let raw = if i < 3 { found.shift_m[i] } else { found.turn[i - 3] };
            let axis = AXES[i % 3];
            let (quantity, unit, scale) = if i < 3 {
                (format!("position along {axis} of the body"), "m", 1.0)
            } else {
                (format!("rotation about its {axis}"), "degrees", 1.0_f64.to_degrees())
            };
            let sigma = found.sigmas[i];
            let outcome = if found.is_determined(i) { outcome(raw, sigma) } else { Outcome::NotObservable };
            if outcome == Outcome::Replaced {
                *kept = raw;
            }
            let text = match outcome {
                Outcome::NotObservable => "the surfaces that both LiDARs measure do not determine it",
                _ => "",
            };
            let difference = raw * scale;
            let sigma = sigma * scale;
            refined.changes.push(Change {
                subject: subject.clone(),
                quantity,
                difference,
                sigma,
                unit,
                outcome,
                text: text.to_owned(),
            });
        }
        let shift = Vector3::new(kept[0], kept[1], kept[2]);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(kept[3], kept[4], kept[5]));
        let pose = Isometry3::from_parts((stated.translation.vector + shift).into(), stated.rotation * turn);
        if let Some(entry) = refined.manifest.other_lidars.get_mut(index - 1).filter(|_| kept != [0.0; 6]) {
            entry.body_from_lidar = pose.into();
        }
    }
    Ok(())
}
