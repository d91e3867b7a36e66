//! `survey.json`: adjusted poses of the submaps of several drives. The clouds stay in their runs.

use super::{Georeference, RunFolder};
use crate::accuracy::{DriveHeights, PointAccuracy, PointResidual};
use crate::error::DeliverError;
use delivery::{PlacedSubmap, corrected};
use files::regular_file;
use geometry::{Geodetic, LocalFrame, Pose, Quaternion, Stamp, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file in the folder of a survey.
pub const SURVEY: &str = "survey.json";
/// Version of the format.
const VERSION: u32 = 1;

/// The whole file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurveyFile {
    /// Version of this format.
    version: u32,
    /// Origin of the east-north-up frame of the survey.
    pub origin: Geodetic,
    /// The drives.
    pub drives: Vec<AdjustedDrive>,
    /// Reasons not to rely on the result as it is.
    pub doubts: Vec<String>,
    /// Why no drive and no control point determines the place of the survey on the Earth. Empty if one does.
    pub unplaced: Vec<String>,
    /// How accurate the result is.
    #[serde(default)]
    pub accuracy: SurveyAccuracy,
}

/// How accurate a survey is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurveyAccuracy {
    /// Accuracy over the control points and over the check points.
    #[serde(flatten)]
    pub points: PointAccuracy,
    /// Mean residual of each point that a submap shows. Control points that contradict the other measurements are included.
    pub residuals: Vec<PointResidual>,
    /// Height differences of each two drives with the ground in common.
    pub heights: Vec<DriveHeights>,
}

/// A drive of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdjustedDrive {
    /// Its name.
    pub name: String,
    /// Folder of its run.
    pub run: PathBuf,
    /// Its submaps.
    pub clouds: Vec<AdjustedCloud>,
}

/// A submap of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdjustedCloud {
    /// Its number in the run.
    pub seq: u64,
    /// Pose in the local frame of the run, as the index of the run states it: translation, m, and unit quaternion x y z w.
    pub run_translation: [f64; 3],
    /// Rotation of this pose.
    pub run_rotation: [f64; 4],
    /// Adjusted pose in the frame of the survey.
    pub translation: [f64; 3],
    /// Rotation of this pose.
    pub rotation: [f64; 4],
    /// Standard deviation of the adjusted position, m: the largest horizontal axis, and up.
    pub sigma_m: [f64; 2],
}

impl SurveyFile {
    /// The content for these drives.
    pub fn new(origin: Geodetic, drives: Vec<AdjustedDrive>) -> Self {
        let [doubts, unplaced] = [Vec::new(), Vec::new()];
        Self { version: VERSION, origin, drives, doubts, unplaced, accuracy: SurveyAccuracy::default() }
    }
}

/// Opens the drives of a survey. Clouds, trajectories and poses are in the east-north-up frame of the survey.
pub fn open_survey(folder: &Path) -> Result<(SurveyFile, Vec<RunFolder>), DeliverError> {
    let path = folder.join(SURVEY);
    let text = regular_file::read_to_string(&path).map_err(DeliverError::file(&path, "read"))?;
    let file: SurveyFile =
        serde_json::from_str(&text).map_err(|error| DeliverError::content(&path, error.to_string()))?;
    let SurveyFile { version, origin, drives, .. } = &file;
    if *version != VERSION {
        return Err(DeliverError::content(&path, format!("version {version}; must be {VERSION}")));
    }
    let Geodetic { latitude_deg, longitude_deg, altitude_m } = *origin;
    if Geodetic::new(latitude_deg, longitude_deg, altitude_m).is_none() {
        let rule = format!("origin {latitude_deg} {longitude_deg} {altitude_m} is not a valid position");
        return Err(DeliverError::content(&path, rule));
    }
    let opened: Result<Vec<RunFolder>, DeliverError> =
        (0..).zip(drives).map(|(number, drive)| open_drive(&path, number, drive, *origin)).collect();
    let opened = opened?;
    Ok((file, opened))
}

fn open_drive(
    file: &Path,
    number: u64,
    AdjustedDrive { name, run, clouds }: &AdjustedDrive,
    origin: Geodetic,
) -> Result<RunFolder, DeliverError> {
    let mut opened = RunFolder::open(run)?;
    let mut submaps = Vec::new();
    for entry in &mut opened.index.clouds {
        let Some(cloud) = clouds.iter().find(|cloud| cloud.seq == entry.seq) else {
            // It stays in the frame of the run.
            entry.sigma_m = None;
            continue;
        };
        if (cloud.run_translation, cloud.run_rotation) != (entry.translation, entry.rotation) {
            let rule = format!(
                "submap {} of drive {name:?} has another pose in {}: the run has changed since the survey\nhint: adjust the survey again",
                entry.seq,
                run.display()
            );
            return Err(DeliverError::content(file, rule));
        }
        let run_from_submap = entry.pose();
        let survey_from_submap = pose(cloud.translation, cloud.rotation);
        opened.corrections.insert(entry.seq, survey_from_submap * run_from_submap.inverse());
        let [horizontal, up] = cloud.sigma_m.map(|m| m as f32);
        entry.translation = cloud.translation;
        entry.rotation = cloud.rotation;
        entry.sigma_m = Some([horizontal, horizontal, up]);
        submaps.push(PlacedSubmap {
            stamp: Stamp(entry.stamp_begin),
            odom_from_submap: run_from_submap,
            world_from_submap: survey_from_submap,
            sigma_m: [horizontal, horizontal, up],
            sigma_rad: entry.sigma_rad.unwrap_or_default(),
            deviation: messages::PoseDeviation::default(),
        });
    }
    opened.trajectory = corrected(&opened.trajectory, &submaps);
    opened.georeference = Some(Georeference::for_local(LocalFrame::new(origin)));
    opened.survey_drive = Some(number);
    opened.survey_name = Some(name.clone());
    Ok(opened)
}

fn pose(translation: [f64; 3], [x, y, z, w]: [f64; 4]) -> Pose {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Pose::from_parts(Vector3::from(translation).into(), rotation)
}
