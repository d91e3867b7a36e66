//! Errors of the trajectory of a run, and of the poses of its submaps.

use super::deviations::SubmapErrors;
use super::place::RunPlace;
use super::pose_error::PoseError;
use crate::evaluate::trajectory::{RUN_TRAJECTORY, Report, report_of_run, true_trajectory};
use anyhow::Context;
use delivery::{INDEX, Index};
use drive::Drive;
use files::regular_file;
use formats::trajectory::TrajectoryFile;
use geometry::{Pose, Trajectory};
use scores::Statistics;
use scores::trajectory::{PosePair, associate};
use std::path::Path;

/// True poses of a simulated drive are 10 ms apart; between poses of a slow INS (4 Hz) a vehicle moves evenly enough.
const MAX_PAUSE_NANOS: i64 = 250_000_000;
/// A run has poses at the end of a sweep and at the start of the next.
const MIN_STEP_NANOS: i64 = 1_000_000;

/// The scores of all poses.
pub struct PoseScores {
    /// Errors after alignment by the trajectory: the shape of the path.
    pub aligned: Report,
    /// Errors in the world, without alignment.
    pub absolute: Option<AbsoluteErrors>,
    /// Reason for missing absolute errors.
    pub without_absolute: Option<String>,
    /// Stated and real deviations of the submaps. `None` if the run states none.
    pub submaps: Option<SubmapErrors>,
}

/// Errors in the world of the truth.
pub struct AbsoluteErrors {
    /// Horizontal errors, m.
    pub horizontal: Option<Statistics>,
    /// Height errors, m.
    pub height: Option<Statistics>,
    /// Heading errors, degrees.
    pub heading: Option<Statistics>,
}

impl PoseScores {
    /// `None` if the run has no trajectory, or none of its poses has a true pose.
    pub fn from_run(drive: &Drive, run: &Path) -> anyhow::Result<Option<Self>> {
        let truth = true_trajectory(drive)?;
        let path = run.join(RUN_TRAJECTORY);
        if !path.exists() {
            return Ok(None);
        }
        let file = TrajectoryFile::load(&path, None).map_err(|problem| anyhow::anyhow!("{problem}"))?;
        let TrajectoryFile::Stamped(estimate) = file else {
            anyhow::bail!("{}: poses without times; a run has a TUM trajectory", path.display())
        };
        let found = associate(&truth, &estimate, MAX_PAUSE_NANOS, MIN_STEP_NANOS);
        if found.pairs.is_empty() {
            return Ok(None);
        }
        let place = RunPlace::from_run(drive, run)?;
        let absolute = match &place {
            RunPlace::World { truth_from_run } => Some(AbsoluteErrors::from_pairs(&found.pairs, truth_from_run)),
            RunPlace::Own(_) | RunPlace::Odometry => None,
        };
        let without_absolute = match &place {
            RunPlace::World { .. } => None,
            RunPlace::Own(reason) => Some(reason.clone()),
            RunPlace::Odometry => Some("the run was not moved to its final frame".to_owned()),
        };
        let submaps = submap_errors(&truth, &place, run)?;
        let aligned = report_of_run(found)?;
        Ok(Some(Self { aligned, absolute, without_absolute, submaps }))
    }
}

impl AbsoluteErrors {
    fn from_pairs(pairs: &[PosePair], truth_from_run: &Pose) -> Self {
        let errors: Vec<PoseError> =
            pairs.iter().map(|pair| PoseError::between(&pair.truth, &(truth_from_run * pair.estimate))).collect();
        let of = |value: fn(&PoseError) -> f64| Statistics::from_values(errors.iter().map(value));
        Self {
            horizontal: of(|error| error.horizontal_m),
            height: of(|error| error.height_m),
            heading: of(|error| error.heading_deg),
        }
    }
}

fn submap_errors(truth: &Trajectory, place: &RunPlace, run: &Path) -> anyhow::Result<Option<SubmapErrors>> {
    let path = run.join(INDEX);
    if *place == RunPlace::Odometry || !path.exists() {
        return Ok(None);
    }
    let text = regular_file::read_to_string(&path).with_context(|| path.display().to_string())?;
    let index: Index = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    let errors = SubmapErrors::from_clouds(truth, place, &index.clouds);
    errors.with_context(|| path.display().to_string())
}
