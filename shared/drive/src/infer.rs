//! The inferred manifest of a folder without `drive.toml`, or of a capture.

use super::listing::files_with_extension;
use super::read::Read;
use super::{Drive, DriveLidar, MANIFEST_FILE};
use crate::manifest::{LidarEntry, Manifest, PoseEntry};
use files::problems::{FileError, FileProblem};
use formats::cloud::check_points;
use formats::kitti;
use lidar::{Lidar, Model, SweepReader, velodyne};
use std::path::{Path, PathBuf};

/// Formats by file name extension, in the order of the search.
const FORMATS: [&str; 4] = ["pcd", "bin", "pcap", "pcapng"];

/// Fails if the first sweep of `*.bin` files is not in the layout of KITTI: rows of x y z intensity.
fn check_rows(path: &Path) -> Result<(), FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(path, rule));
    let hint = "without drive.toml, *.bin must be sweeps of KITTI; use `replica import` or write a drive.toml";
    if path.to_string_lossy().ends_with(".pcd.bin") {
        return Err(problem(format!("is a sweep of nuScenes; {hint}")));
    }
    let bytes = std::fs::read(path).map_err(|error| problem(error.to_string()))?;
    let points = kitti::points_from_bin(&bytes).map_err(|error| problem(format!("{error}; {hint}")))?;
    check_points(&points, 1.0).map_err(|error| problem(format!("{error}; {hint}")))
}

/// Infers a manifest from the files in a folder.
pub(super) fn read(folder: &Path) -> Result<Read, FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(folder, rule));
    for extension in FORMATS {
        let files = files_with_extension(folder, &[extension]).map_err(|error| problem(error.to_string()))?;
        if files.is_empty() {
            continue;
        }
        if extension == "bin" {
            check_rows(&files[0])?;
        }
        let is_capture = extension.starts_with("pcap");
        let model = if is_capture { model_of(files).map_err(problem)? } else { velodyne::Model::Hdl64e.into() };
        let manifest = manifest(folder, model, if is_capture { "pcap" } else { extension });
        return Ok(Read::inferred(&folder.join(MANIFEST_FILE), manifest));
    }
    Err(problem(format!("contains neither {MANIFEST_FILE} nor *.{}", FORMATS.join(", *."))))
}

/// The drive that consists of one capture.
pub(super) fn drive_from_capture(file: &Path) -> Result<Drive, FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(file, rule));
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    if !extension.is_some_and(|extension| extension.starts_with("pcap")) {
        return Err(problem(format!(
            "is not a drive: a drive is a folder with {MANIFEST_FILE} or with files *.{}, or a capture *.pcap or *.pcapng",
            FORMATS.join(", *.")
        )));
    }
    let model = model_of(vec![file.to_owned()]).map_err(problem)?;
    let manifest = manifest(file, model, "pcap");
    let rig = manifest.rig().map_err(|error| problem(error.to_string()))?;
    Ok(Drive {
        folder: file.parent().unwrap_or(Path::new(".")).to_owned(),
        manifest,
        rig,
        first_lidar: DriveLidar {
            lidar: Lidar::from(model),
            format: "pcap".to_owned(),
            files: vec![file.to_owned()],
            stamps: Vec::new(),
        },
        other_lidars: Vec::new(),
        is_inferred: true,
        camera_frames: Vec::new(),
        mosaic_frames: Vec::new(),
        sensors: Vec::new(),
        unnamed_files: Vec::new(),
    })
}

/// The model whose packets the captures contain.
fn model_of(captures: Vec<PathBuf>) -> Result<Model, String> {
    SweepReader::open(captures, None).map(|reader| reader.model()).map_err(|error| error.to_string())
}

/// The manifest of a drive with only a LiDAR. The body frame is the lidar frame.
fn manifest(path: &Path, model: Model, format: &str) -> Manifest {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Manifest::with_lidar(&name, LidarEntry::new(model.name(), format, ".", PoseEntry::IDENTITY))
}
