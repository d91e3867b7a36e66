//! The inferred manifest of a folder without `drive.toml`.

use super::MANIFEST_FILE;
use super::listing::files_with_extension;
use super::read::Read;
use crate::cloud::check_points;
use crate::kitti;
use crate::manifest::{LidarEntry, Manifest, PoseEntry};
use crate::problems::{FileError, FileProblem};
use crate::velodyne::{Model, SweepReader};
use std::path::Path;

/// Formats by file name extension, in the order of the search.
const FORMATS: [&str; 4] = ["pcd", "bin", "pcap", "pcapng"];

/// Fails if the first sweep of `*.bin` files is not one of KITTI: rows of x y z intensity.
fn check_rows(path: &Path) -> Result<(), FileError> {
    let problem = |rule: String| FileError::from(FileProblem::of_file(path, rule));
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
    let problem = |rule: String| FileError::from(FileProblem::of_file(folder, rule));
    for extension in FORMATS {
        let files = files_with_extension(folder, &[extension]).map_err(|error| problem(error.to_string()))?;
        if files.is_empty() {
            continue;
        }
        if extension == "bin" {
            check_rows(&files[0])?;
        }
        let is_capture = extension.starts_with("pcap");
        let model = if is_capture {
            SweepReader::open(files, None).map_err(|error| problem(error.to_string()))?.model()
        } else {
            Model::Hdl64e
        };
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let manifest = Manifest::of_lidar(
            &name,
            LidarEntry {
                model: model.name().to_owned(),
                format: if is_capture { "pcap" } else { extension }.to_owned(),
                folder: ".".to_owned(),
                body_from_lidar: PoseEntry::IDENTITY,
            },
        );
        return Ok(Read::inferred(&folder.join(MANIFEST_FILE), manifest));
    }
    Err(problem(format!("contains neither {MANIFEST_FILE} nor *.{}", FORMATS.join(", *."))))
}
