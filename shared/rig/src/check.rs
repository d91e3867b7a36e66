//! Checks whether a rig fits the data of its drive.

mod cameras;
mod chirality;
mod clocks;
mod gnss;
mod hypotheses;
mod imu;
mod level;
mod secondary_lidars;
mod spin;
mod travel;
mod verdict;

pub use cameras::CameraScores;
pub(crate) use hypotheses::turned;
pub(crate) use imu::{quaternion, rotation_of};
pub use level::{Level, level};
pub use spin::SpinCosts;
pub use travel::{Travel, travel};
pub use verdict::{Answer, Verdict};

use crate::error::RigError;
use crate::survey::{Survey, SurveySettings};
use drive::Drive;
use registration::SpinDirection;

/// The verdicts about a drive.
pub struct Report {
    /// The verdicts, in the order of the checks.
    pub verdicts: Vec<Verdict>,
}

impl Report {
    /// Checks a drive. `settings` are the settings of its survey.
    pub fn from_survey(drive: &Drive, survey: &Survey, settings: &SurveySettings) -> Result<Self, RigError> {
        let mut verdicts = clocks::verdicts(survey);
        let is_late = |verdicts: &[Verdict], name: &str| {
            verdicts.iter().any(|verdict| verdict.is_doubt() && verdict.subject == name)
        };
        let of_lidar = lidar_verdicts(drive, survey, settings.untimed_turn);
        let blames_lidar = of_lidar.iter().any(Verdict::is_doubt) || is_late(&verdicts, clocks::LIDAR);
        verdicts.extend(of_lidar);
        if blames_lidar {
            let others = 1..drive.lidars().count();
            verdicts.extend(others.map(|index| Verdict::after_lidar(&drive.manifest().lidar_name(index))));
        } else {
            verdicts.extend(secondary_lidars::verdicts(drive, survey, settings)?);
        }
        if drive.manifest().imu.is_some() {
            verdicts.extend(match (blames_lidar, is_late(&verdicts, "imu")) {
                (true, _) => vec![Verdict::after_lidar("imu")],
                (_, true) => Vec::new(),
                _ => imu::verdicts(drive, survey),
            });
        }
        if drive.manifest().gnss.is_some() {
            verdicts.extend(gnss::place(drive, survey, !blames_lidar));
            if !is_late(&verdicts, "gnss") && !blames_lidar {
                verdicts.extend(gnss::motion(survey));
            }
        }
        let names = drive.manifest().cameras.iter().map(|entry| entry.name.as_str());
        let on_time: Vec<bool> = names.map(|name| !is_late(&verdicts, name)).collect();
        if blames_lidar {
            verdicts.extend(drive.manifest().cameras.iter().map(|entry| Verdict::after_lidar(&entry.name)));
        } else {
            verdicts.extend(cameras::verdicts(drive, survey, &on_time));
        }
        Ok(Self { verdicts })
    }

    /// The verdicts that are doubts.
    pub fn doubts(&self) -> impl Iterator<Item = &Verdict> {
        self.verdicts.iter().filter(|verdict| verdict.is_doubt())
    }
}

/// Verdicts about the mounting of the LiDAR, and whether its points are consistent with a spinning sensor.
fn lidar_verdicts(drive: &Drive, survey: &Survey, untimed_turn: Option<SpinDirection>) -> Vec<Verdict> {
    let mirrored = chirality::verdict(survey);
    if mirrored.is_doubt() {
        return vec![mirrored];
    }
    let mut verdicts = vec![mirrored, spin::verdict(drive, survey, untimed_turn)];
    verdicts.extend(level::verdicts(drive, survey));
    verdicts.push(travel::verdict(survey));
    verdicts
}
