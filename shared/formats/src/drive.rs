//! The drive folder: everything that a vehicle recorded on one drive (`docs/drive.md`).
//!
//! A folder with a `drive.toml` says what it holds. A bare folder of `*.pcd`, `*.bin` or `*.pcap` files is taken as a LiDAR
//! recording without other sensors, see [`Drive::open`].

mod check;
mod clouds;
mod infer;
mod labels;
mod listing;
mod read;
mod sweeps;

pub use clouds::returns_from_cloud;
pub use labels::{TrueLabel, TrueLabels};
pub use listing::Frame;
pub use sweeps::{DriveSweep, SourcePosition, SweepSource};

use crate::imu::ImuReader;
use crate::manifest::Manifest;
use crate::nmea::{self, Fix, LogStats};
use crate::problems::{FileError, FileProblem};
use crate::sensor_calibration::SensorCalibration;
use crate::trajectory::trajectory_from_tum;
use crate::velodyne::{Model, SweepError};
use geometry::{Rig, Stamp, Trajectory};
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// Name of the manifest.
pub const MANIFEST_FILE: &str = "drive.toml";
/// Stamps of the sweeps of a drive of clouds: in the LiDAR's folder, one a line, ns since the Unix epoch.
pub const TIMES_FILE: &str = "times.txt";

/// A drive folder whose manifest has been checked against what is there.
#[derive(Clone, Debug)]
pub struct Drive {
    folder: PathBuf,
    manifest: Manifest,
    rig: Rig,
    model: Model,
    is_inferred: bool,
    sweep_files: Vec<PathBuf>,
    /// Of sweeps that are one file each; empty for captures.
    sweep_stamps: Vec<Stamp>,
    camera_frames: Vec<Frame>,
    mosaic_frames: Vec<Frame>,
    sensors: Vec<Option<SensorCalibration>>,
    strange_files: Vec<PathBuf>,
}

impl Drive {
    /// Reads the manifest and looks at every file name. The error has all problems at once.
    ///
    /// Without `drive.toml`, the folder must hold clouds or captures. Clouds are taken for an HDL-64E's at 10 Hz, as KITTI
    /// has them: sweep k is at k times 0.1 s, points have no times, body and lidar frame are one, no cameras. Captures
    /// name their sensor themselves.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        if !folder.is_dir() {
            return Err(FileProblem::of_file(folder, "is no folder").into());
        }
        let path = folder.join(MANIFEST_FILE);
        let (read, is_inferred) = match fs::read_to_string(&path) {
            Ok(text) => (read::Read::of_text(&path, text), false),
            Err(error) if error.kind() == io::ErrorKind::NotFound => (infer::read(folder)?, true),
            Err(error) => return Err(FileProblem::of_file(&path, format!("cannot be read: {error}")).into()),
        };
        check::drive(folder, read, is_inferred)
    }

    /// The manifest alone, without a look at the files it names: the rig of a vehicle before its recording is there. `None` if
    /// the folder has no `drive.toml`.
    pub fn rig_alone(folder: &Path) -> Result<Option<Manifest>, FileError> {
        let path = folder.join(MANIFEST_FILE);
        if path.exists() { read_manifest(&path).map(Some) } else { Ok(None) }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
    /// What it says of itself.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
    /// How the sensors are mounted.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }
    /// The LiDAR.
    pub fn model(&self) -> Model {
        self.model
    }
    /// Whether there is no `drive.toml`, so that the manifest is an assumption.
    pub fn is_inferred(&self) -> bool {
        self.is_inferred
    }
    /// Captures or clouds in the order of their names.
    pub fn sweep_files(&self) -> &[PathBuf] {
        &self.sweep_files
    }
    /// Exposures of all color cameras, by stamp, then camera.
    pub fn camera_frames(&self) -> &[Frame] {
        &self.camera_frames
    }
    /// Exposures of all mosaic cameras, by stamp, then camera.
    pub fn mosaic_frames(&self) -> &[Frame] {
        &self.mosaic_frames
    }
    /// The maker's calibration of each mosaic camera, where the manifest names one.
    pub fn sensors(&self) -> &[Option<SensorCalibration>] {
        &self.sensors
    }
    /// Files in the cameras' folders whose names are no stamps.
    pub fn strange_files(&self) -> &[PathBuf] {
        &self.strange_files
    }

    /// The sweeps, from the first.
    pub fn sweeps(&self) -> Result<SweepSource, SweepError> {
        SweepSource::open(self)
    }

    /// All position fixes; none if the drive has no receiver.
    pub fn fixes(&self) -> io::Result<(Vec<Fix>, LogStats)> {
        match &self.manifest.gnss {
            Some(entry) => Ok(nmea::fixes(&fs::read(self.folder.join(&entry.file))?)),
            None => Ok((Vec::new(), LogStats::default())),
        }
    }

    /// The inertial samples, if there are any.
    pub fn imu(&self) -> io::Result<Option<ImuReader<BufReader<File>>>> {
        let open = |file: &String| Ok(ImuReader::new(BufReader::new(File::open(self.folder.join(file))?)));
        self.manifest.imu.as_ref().map(|entry| open(&entry.file)).transpose()
    }

    /// True poses, if they are known.
    pub fn true_trajectory(&self) -> Option<Result<Trajectory, FileProblem>> {
        let path = self.folder.join(&self.manifest.truth.as_ref()?.trajectory);
        let text = fs::read_to_string(&path).map_err(|error| FileProblem::of_file(&path, error.to_string()));
        Some(text.and_then(|text| {
            trajectory_from_tum(&text).map_err(|error| FileProblem::of_file(&path, error.to_string()))
        }))
    }
}

/// Reads a `drive.toml`, wherever it is, and checks its LiDAR and its poses but not the files that it names. The error has all
/// problems at once.
pub fn read_manifest(path: &Path) -> Result<Manifest, FileError> {
    let text = fs::read_to_string(path);
    let text = text.map_err(|error| FileProblem::of_file(path, format!("cannot be read: {error}")))?;
    check::manifest(read::Read::of_text(path, text))
}
