//! The drive folder: all recordings of one drive (`docs/reference/drive_folder.md`).
//!
//! `drive.toml` ([`manifest`]) describes the folder: sensors, mounting, files. [`Drive::open`] checks it against the
//! files, so that all faults of a folder are reported before a run starts, each with file, line, key and rule. A folder
//! of `*.pcd`, `*.bin` or `*.pcap` files, of one kind only, without `drive.toml` is read as a LiDAR recording.
//!
//! A [`Drive`] lists frames and opens readers: [`SweepSource`] for sweeps of packets or of clouds, [`imu`] for samples, [`LabelReader`] for
//! ground truth. It holds no image and no cloud in memory.
//!
//! **Frames.** Mountings are `body_from_<sensor>`; body x forward, y left, z up. Stamps are ns since the Unix epoch,
//! after subtraction of the delays of `drive.toml`.
//!
//! **Never**: merging sensors by time (crate `acquisition`), making folders from other layouts (crate `import`).
//!
//! **Start reading** at [`Drive::open`], then [`SweepSource::next_sweep`].

mod camera_rig;
mod check;
mod cloud_reader;
mod clouds;
pub mod imu;
mod infer;
mod labelled_sweep;
mod labels;
mod lidar_file;
mod lidars;
mod listing;
mod live_rig;
pub mod manifest;
mod numbering;
mod read;
mod rings;
mod slices;
mod sweeps;

pub use camera_rig::CameraRig;
pub use clouds::{is_return, returns_from_cloud};
pub use infer::{KindOfFiles, unnamed_captures};
pub use labelled_sweep::{LabelledSweep, NoLabel, Shot, TrueLabel};
pub use labels::{LabelReader, TrueLabels, find_label};
pub use lidar::SweepInfo;
pub use lidar_file::lidar_of;
pub use lidars::DriveLidar;
pub use listing::{Frame, frame_stamp, is_image_name, is_mosaic_name};
pub use live_rig::LiveRig;
pub use numbering::Missing;
pub use sweeps::{CloudSample, SourcePosition, SweepSource};

use crate::imu::ImuReader;
use crate::manifest::{ImuEntry, Manifest};
use files::problems::{FileError, FileProblem};
use files::regular_file;
use files::text_file::{MAX_SETTINGS_BYTES, read_long_text, read_text};
use formats::sensor_calibration::SensorCalibration;
use formats::trajectory::trajectory_from_tum;
use geometry::{Rig, Stamp, Trajectory};
use lidar::nmea::{self, Fix, LogStats};
use lidar::{Lidar, Model, SweepError};
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// Name of the manifest file.
pub const MANIFEST_FILE: &str = "drive.toml";
/// Stamps of cloud files: in the LiDAR folder, one per line, ns since the Unix epoch.
pub const TIMES_FILE: &str = "times.txt";

/// A drive folder whose manifest was checked against its files.
#[derive(Clone, Debug)]
pub struct Drive {
    folder: PathBuf,
    manifest: Manifest,
    rig: Rig,
    first_lidar: DriveLidar,
    other_lidars: Vec<DriveLidar>,
    is_inferred: bool,
    camera_frames: Vec<Frame>,
    mosaic_frames: Vec<Frame>,
    sensors: Vec<Option<SensorCalibration>>,
    unnamed_files: Vec<PathBuf>,
}

impl Drive {
    /// Reads the manifest and lists all files. The error contains all problems.
    ///
    /// Without `drive.toml`, the folder must contain clouds or captures. Clouds are read as sweeps of an HDL-64E at 10
    /// Hz, as in KITTI: sweep k has the time k times 0.1 s, points have no times, and the body frame is the lidar frame.
    /// The sensor of captures is detected from their packets.
    ///
    /// A path to a capture instead of a folder opens a drive of this capture alone, as in a folder without `drive.toml`.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        if folder.is_file() {
            return infer::drive_from_capture(folder);
        }
        if !folder.is_dir() {
            return Err(FileProblem::for_file(folder, "not a folder").into());
        }
        let path = folder.join(MANIFEST_FILE);
        let (read, is_inferred) = match read_text(&path, MAX_SETTINGS_BYTES) {
            Ok(text) => (read::Read::from_text(&path, text), false),
            Err(error) if error.is_absent() => (infer::read(folder)?, true),
            Err(error) => return Err(FileProblem::for_file(&path, format!("cannot read the file: {error}")).into()),
        };
        check::drive(folder, read, is_inferred)
    }

    /// Path of the folder; for a drive that is a capture, the folder that contains the capture.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
    /// The manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
    /// Mounting of the sensors.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }
    /// The first LiDAR, with the calibration of its unit.
    pub fn lidar(&self) -> &Lidar {
        &self.first_lidar.lidar
    }
    /// Model of the first LiDAR.
    pub fn model(&self) -> Model {
        self.lidar().model()
    }
    /// All LiDARs, the first one first.
    pub fn lidars(&self) -> impl Iterator<Item = &DriveLidar> {
        std::iter::once(&self.first_lidar).chain(&self.other_lidars)
    }
    /// Whether the folder has no `drive.toml` and the manifest was inferred.
    pub fn is_inferred(&self) -> bool {
        self.is_inferred
    }
    /// Captures of the first LiDAR in the order of their times, or clouds in the natural order of their names.
    pub fn sweep_files(&self) -> &[PathBuf] {
        &self.first_lidar.files
    }
    /// Stamps of clouds, one per file of [`Drive::sweep_files`]; empty for captures.
    pub fn sweep_stamps(&self) -> &[Stamp] {
        &self.first_lidar.stamps
    }
    /// Exposures of all color cameras, by stamp, then camera.
    pub fn camera_frames(&self) -> &[Frame] {
        &self.camera_frames
    }
    /// Exposures of all mosaic cameras, by stamp, then camera.
    pub fn mosaic_frames(&self) -> &[Frame] {
        &self.mosaic_frames
    }
    /// Manufacturer's calibration of each mosaic camera, if the manifest names one.
    pub fn sensors(&self) -> &[Option<SensorCalibration>] {
        &self.sensors
    }
    /// Band centers of the cubes of each mosaic camera, nm: the virtual bands of its calibration if there is one, because `calibrate`
    /// corrects by default; otherwise the bands of its filters.
    pub fn expected_bands(&self) -> Vec<Vec<f32>> {
        camera_rig::expected_bands(&self.manifest.mosaics, &self.sensors)
    }
    /// Files in camera folders whose names are not stamps.
    pub fn strange_files(&self) -> &[PathBuf] {
        &self.unnamed_files
    }

    /// A reader of the sweeps of the first LiDAR, at the first.
    pub fn sweeps(&self) -> Result<SweepSource, SweepError> {
        SweepSource::open(&self.first_lidar)
    }

    /// All position fixes, with the delay of their stamps subtracted; empty if the drive has no GNSS receiver.
    pub fn fixes(&self) -> io::Result<(Vec<Fix>, LogStats)> {
        match &self.manifest.gnss {
            Some(entry) => {
                let (mut fixes, stats) =
                    nmea::fixes_above_geoid(&regular_file::read(self.folder.join(&entry.file))?, entry.geoid_m);
                for fix in &mut fixes {
                    fix.stamp = fix.stamp.plus_nanos(entry.delay_nanos.saturating_neg());
                }
                Ok((fixes, stats.in_file(&entry.file)))
            }
            None => Ok((Vec::new(), LogStats::default())),
        }
    }

    /// A reader of the IMU samples, with the delay of their stamps subtracted, if the drive has an IMU.
    pub fn imu(&self) -> io::Result<Option<ImuReader<BufReader<File>>>> {
        let open = |entry: &ImuEntry| {
            let reader = ImuReader::new(BufReader::new(regular_file::open(self.folder.join(&entry.file))?));
            let reader = reader.delayed(entry.delay_nanos);
            Ok(if entry.body_from_imu.is_some() { reader.rotated(entry.mounting().rotation) } else { reader })
        };
        self.manifest.imu.as_ref().map(open).transpose()
    }

    /// Ground-truth trajectory, if the drive has one.
    pub fn true_trajectory(&self) -> Option<Result<Trajectory, FileProblem>> {
        let path = self.folder.join(&self.manifest.truth.as_ref()?.trajectory);
        let text = read_long_text(&path).map_err(|error| FileProblem::for_file(&path, error.to_string()));
        Some(text.and_then(|text| {
            trajectory_from_tum(&text).map_err(|error| FileProblem::for_file(&path, error.to_string()))
        }))
    }
}

/// Reads a `drive.toml` in any folder. Checks the LiDAR and the poses; of the files, only the calibration of the LiDAR.
/// The error contains all problems.
pub fn read_manifest(path: &Path) -> Result<Manifest, FileError> {
    let text = read_text(path, MAX_SETTINGS_BYTES);
    let text = text.map_err(|error| FileProblem::for_file(path, format!("cannot read the file: {error}")))?;
    check::manifest(path.parent().unwrap_or(Path::new("")), read::Read::from_text(path, text))
}
