//! The LiDAR of a manifest, with its calibration file.

use crate::manifest::LidarEntry;
use files::problems::FileProblem;
use files::text_file::{MAX_CALIBRATION_BYTES, read_text};
use lidar::{Lidar, Model, Origin};
use std::path::Path;

/// The LiDAR of an entry. `folder` contains the manifest; the path of the calibration file is relative to it. `key` is
/// the key of the entry in the manifest, such as `lidar` or `lidar[1]`.
pub fn lidar_of(folder: &Path, key: &str, entry: &LidarEntry) -> Result<Lidar, FileProblem> {
    let problem =
        |name: &str, rule: String| FileProblem { key: format!("{key}.{name}"), ..FileProblem::for_file(folder, rule) };
    let model = Model::from_name(&entry.model);
    let model =
        model.ok_or_else(|| problem("model", format!("value {:?} must be one of {}", entry.model, Model::names())))?;
    let origin = Origin { sender: entry.sender, port: entry.port };
    let Some(name) = &entry.calibration else { return Ok(Lidar::from(model).with_origin(origin)) };
    let path = folder.join(name);
    let fault = |text: String| problem("calibration", format!("{}: {text}", path.display()));
    let text = read_text(&path, MAX_CALIBRATION_BYTES).map_err(|error| fault(error.to_string()))?;
    let lidar = Lidar::with_calibration(model, name, text).map_err(|error| fault(error.to_string()))?;
    Ok(lidar.with_origin(origin))
}
