//! The mounting of the first LiDAR along given paths.

use super::{Change, Outcome, Refined, outcome};
use crate::boresight::Boresight;
use crate::error::RigError;
use crate::survey::SurveySettings;
use drive::Drive;
use geometry::{Isometry3, UnitQuaternion, Vector3};

/// The values of a mounting, in the order of [`Boresight::sigmas`].
const QUANTITIES: [&str; 6] = [
    "position along x of the body",
    "position along y of the body",
    "position along z of the body",
    "roll (about x of the body)",
    "pitch (about y of the body)",
    "heading (about z of the body)",
];
/// Reasons why passes do not determine a value.
const UNDETERMINED: [&str; 6] = [
    "drive in both directions past surfaces that face along the track",
    "passes in both directions show it only if the offset between their paths is known better",
    "all passes are shifted alike",
    "drive the same street in both directions",
    "few surfaces are seen both ahead and behind",
    "few upright surfaces are seen from several places",
];

impl Refined {
    /// Refines the mounting of the first LiDAR by the path of its drive and of `passes`, further drives of the same vehicle
    /// through the same streets.
    pub fn add_boresight(
        &mut self,
        drive: &Drive,
        passes: &[Drive],
        settings: &SurveySettings,
    ) -> Result<(), RigError> {
        let subject = self.manifest.lidar_name(0).into_owned();
        let drives: Vec<&Drive> = std::iter::once(drive).chain(passes).collect();
        let Some(found) = Boresight::measure(&drives, settings)? else {
            self.changes.push(Change {
                subject,
                quantity: "mounting".to_owned(),
                difference: 0.0,
                sigma: 0.0,
                unit: "m",
                outcome: Outcome::NotObservable,
                text: "hardly any surface is seen in several passes".to_owned(),
            });
            return Ok(());
        };
        let mut kept = [0.0; 6];
        for (i, kept) in kept.iter_mut().enumerate() {
            let (raw, unit, scale) = match i {
                0..3 => (found.shift_m[i], "m", 1.0),
                _ => (found.turn[i - 3], "degrees", 1.0_f64.to_degrees()),
            };
            let sigma = found.sigmas[i];
            let outcome = if found.is_determined(i) { outcome(raw, sigma) } else { Outcome::NotObservable };
            if outcome == Outcome::Replaced {
                *kept = raw;
            }
            let text = if outcome == Outcome::NotObservable { UNDETERMINED[i] } else { "" };
            self.changes.push(Change {
                subject: subject.clone(),
                quantity: QUANTITIES[i].to_owned(),
                difference: raw * scale,
                sigma: sigma * scale,
                unit,
                outcome,
                text: text.to_owned(),
            });
        }
        if kept != [0.0; 6] {
            let stated = drive.rig().body_from_lidar;
            let shift = Vector3::new(kept[0], kept[1], kept[2]);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(kept[3], kept[4], kept[5]));
            let pose = Isometry3::from_parts((stated.translation.vector + shift).into(), turn * stated.rotation);
            self.manifest.lidar.body_from_lidar = pose.into();
        }
        Ok(())
    }
}
