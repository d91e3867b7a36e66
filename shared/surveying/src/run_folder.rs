//! The output folder of a finished run (`docs/reference/outputs.md`).

mod georeference;
mod survey;

pub use georeference::Georeference;
pub use survey::{AdjustedCloud, AdjustedDrive, SURVEY, SurveyAccuracy, SurveyFile, open_survey};

use crate::cloud::{Cloud, CloudPoint};
use crate::error::DeliverError;
use delivery::{CloudEntry, GEOREFERENCE, INDEX, Index};
use files::regular_file;
use formats::trajectory::TrajectoryFile;
use geometry::{Pose, Trajectory};
use messages::columns::{COLUMNS, Column};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files that may hold the trajectory with its times; the first existing file is read.
const TRAJECTORIES: [&str; 2] = ["trajectory.txt", "trajectory.csv"];

/// The files of a finished run, without the points.
pub struct RunFolder {
    path: PathBuf,
    /// The clouds.
    pub index: Index,
    /// Placement of the clouds on the Earth. `None` for runs in the frame of the odometry.
    pub georeference: Option<Georeference>,
    /// `world_from_body` in the local frame.
    pub trajectory: Trajectory,
    /// Columns that clouds may have.
    pub(crate) columns: &'static [Column],
    /// Index of the drive in a survey.
    pub(crate) survey_drive: Option<u64>,
    /// Name of the drive in a survey.
    pub(crate) survey_name: Option<String>,
    /// Motion of the points of each cloud by the adjustment of a survey.
    corrections: BTreeMap<u64, Pose>,
}

impl RunFolder {
    /// Reads the folder of a run with the columns of [`COLUMNS`].
    pub fn open(path: &Path) -> Result<Self, DeliverError> {
        Self::open_with(path, COLUMNS)
    }

    /// Reads the folder of a run whose clouds may have these columns.
    pub fn open_with(path: &Path, columns: &'static [Column]) -> Result<Self, DeliverError> {
        let index_path = path.join(INDEX);
        if !index_path.exists() {
            let rule = format!(
                "has no {INDEX}: the run wrote no clouds\nhint: run the drive with the stages acquire, slam_aggregate and export"
            );
            return Err(DeliverError::content(path, rule));
        }
        let text = regular_file::read_to_string(&index_path).map_err(DeliverError::file(&index_path, "read"))?;
        let index: Index =
            serde_json::from_str(&text).map_err(|error| DeliverError::content(&index_path, error.to_string()))?;
        let georeference_path = path.join(GEOREFERENCE);
        let georeference = georeference_path.exists().then(|| Georeference::load(&georeference_path)).transpose()?;
        let trajectory = load_trajectory(path)?;
        Ok(Self {
            path: path.to_owned(),
            index,
            georeference,
            trajectory,
            columns,
            survey_drive: None,
            survey_name: None,
            corrections: BTreeMap::new(),
        })
    }

    /// Motion of the points of a cloud by the adjustment of a survey.
    pub(crate) fn correction(&self, seq: u64) -> Option<Pose> {
        self.corrections.get(&seq).copied()
    }
    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
    /// Path of the cloud of a submap.
    pub fn cloud(&self, entry: &CloudEntry) -> PathBuf {
        self.path.join(&entry.file)
    }
    /// Passes each point of a cloud that is in the frame of the run to `take`.
    pub fn each_point(&self, entry: &CloudEntry, mut take: impl FnMut(&CloudPoint)) -> Result<(), DeliverError> {
        let Some(cloud) = Cloud::open(self, entry)? else { return Ok(()) };
        cloud.each_block(|_, rows| {
            rows.chunks_exact(cloud.columns.row_size()).for_each(|row| take(&cloud.columns.point(row)));
            Ok(())
        })
    }
    /// Angle from the y axis of the trajectory to the y axis of the clouds, clockwise, rad.
    pub(crate) fn convergence(&self) -> f64 {
        self.georeference.as_ref().map_or(0.0, Georeference::convergence)
    }
    /// Time of the first shot, ns since the Unix epoch. `None` without clouds.
    pub fn begin_nanos(&self) -> Option<i64> {
        self.index.clouds.iter().map(|cloud| cloud.stamp_begin).min()
    }
}

/// The trajectory of a run, from the first existing file with times.
pub fn load_trajectory(run: &Path) -> Result<Trajectory, DeliverError> {
    let path = TRAJECTORIES.iter().map(|name| run.join(name)).find(|path| path.exists());
    let rule = "has no trajectory.txt or trajectory.csv\nhint: run with [export] trajectory = [\"tum\"]";
    let path = path.ok_or_else(|| DeliverError::content(run, rule))?;
    match TrajectoryFile::load(&path, None) {
        Ok(TrajectoryFile::Stamped(trajectory)) => Ok(trajectory),
        Ok(TrajectoryFile::Numbered(_)) => Err(DeliverError::content(&path, "has poses without times")),
        Err(error) => Err(DeliverError::content(&path, error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory};
    use geometry::{Isometry3, Stamp};

    #[test]
    fn trajectory_is_read_from_any_file_with_times() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut trajectory = Trajectory::default();
        for i in 0..3 {
            let pose = Isometry3::translation(f64::from(i), 0.5, 0.0);
            trajectory.push(Stamp(1_000_000_000 * i64::from(i)), pose);
        }
        std::fs::write(folder.path().join("trajectory_kitti.txt"), kitti_from_trajectory(&trajectory)).expect("writes");
        let error = load_trajectory(folder.path()).expect_err("the KITTI file has no times");
        assert!(error.to_string().contains("has no trajectory.txt or trajectory.csv"), "{error}");
        std::fs::write(folder.path().join("trajectory.csv"), csv_from_trajectory(&trajectory)).expect("writes");
        assert_eq!(load_trajectory(folder.path()).expect("reads").poses(), trajectory.poses());
    }
}
