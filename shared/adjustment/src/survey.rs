//! The adjustment of a survey, step by step.

use crate::control::{ControlPoint, SeenControl, seen};
use crate::drives::Submaps;
use crate::error::SurveyError;
use crate::matches::{Match, fine_matches};
use crate::meetings::meetings;
use crate::network::{Adjusted, RunPose, adjust};
use geometry::Pose;

/// Rounds of fine matches: the first starts some decimetres off, the second one ends within a centimetre.
const ROUNDS: usize = 2;
/// Least weight of a measurement that agrees with the result.
pub(crate) const MIN_WEIGHT: f64 = 0.25;

/// A measurement, and whether it agrees with the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Weighed<T> {
    /// The measurement.
    pub measured: T,
    /// Whether it has at least a quarter of its weight in the solution.
    pub agrees: bool,
}

/// The result.
pub struct Survey {
    /// Poses of the submaps from their runs.
    pub before: Vec<Pose>,
    /// Adjusted poses.
    pub after: Vec<Pose>,
    /// Standard deviation of each submap, m: horizontally and up.
    pub sigma_m: Vec<[f64; 2]>,
    /// Matches between drives.
    pub matches: Vec<Weighed<Match>>,
    /// Control points where submaps show them.
    pub control: Vec<Weighed<SeenControl>>,
    /// Check points where submaps show them.
    pub check: Vec<SeenControl>,
}

/// Adjusts the submaps of all drives to each other and to the control points. Check points are only looked up.
pub fn adjust_survey(submaps: &Submaps, points: &[ControlPoint]) -> Result<Survey, SurveyError> {
    let before: Vec<Pose> = submaps.all.iter().map(|submap| submap.survey_from_submap).collect();
    let run_poses: Vec<RunPose> = submaps.all.iter().map(RunPose::from).collect();
    let mut adjusted = adjust(&run_poses, &before, meetings(submaps), &[])?;
    let mut matches = Vec::new();
    let mut control = Vec::new();
    for _ in 0..ROUNDS {
        matches = fine_matches(submaps, &adjusted.poses);
        control = seen(submaps, &adjusted.poses, points);
        control.retain(|seen| points[seen.point].is_control());
        let relative = matches.iter().map(|found| found.relative.clone()).collect();
        adjusted = adjust(&run_poses, &adjusted.poses, relative, &control)?;
    }
    let Adjusted { poses: after, sigma_m, match_weights, control_weights } = adjusted;
    let mut check = seen(submaps, &after, points);
    check.retain(|seen| !points[seen.point].is_control());
    let matches = weighed(matches, &match_weights);
    let control = weighed(control, &control_weights);
    Ok(Survey { before, after, sigma_m, matches, control, check })
}

fn weighed<T>(measured: Vec<T>, weights: &[f64]) -> Vec<Weighed<T>> {
    let weighed = |(measured, weight): (T, &f64)| Weighed { measured, agrees: *weight >= MIN_WEIGHT };
    measured.into_iter().zip(weights).map(weighed).collect()
}
