//! nuScenes (Caesar et al., CVPR 2020), with or without its tables.

mod boxes;
mod category;
mod labels;
mod scene;
mod scene_choice;
mod sweep_files;
mod table;

use crate::Options;
use crate::error::{At, ImportError};
use crate::plan::Plan;
use crate::sweeps::LIDAR_FOLDER;
use drive::manifest::{LidarEntry, PoseEntry};
use lidar::velodyne;
use std::path::{Path, PathBuf};

/// Key frames are in `samples`, the sweeps between them in `sweeps`.
pub(crate) fn lidar_folders(source: &Path) -> impl Iterator<Item = PathBuf> {
    ["samples/LIDAR_TOP", "sweeps/LIDAR_TOP"].map(|folder| source.join(folder)).into_iter().filter(|path| path.is_dir())
}

/// The drive of a scene, or of the sweeps of a log.
pub(crate) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let tables = if options.lidar_only { Vec::new() } else { table_folders(source)? };
    if !tables.is_empty() {
        return scene::plan(source, &tables, options);
    }
    if options.scene.is_some() {
        return Err(ImportError::for_option("--scene", "needs the tables: a folder v1.0-* with sample_data.json"));
    }
    let mut plan = sweep_files::plan(source, options)?;
    if !options.lidar_only {
        plan.report.push("no tables (v1.0-*/sample_data.json): sweeps alone, without cameras, poses and labels".into());
    }
    Ok(plan)
}

/// Folders of tables, one for each version of the data set.
fn table_folders(source: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let mut folders = Vec::new();
    for entry in source.read_dir().at(source)? {
        let path = entry.at(source)?.path();
        let is_version = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("v1.0-"));
        if is_version && path.join("sample_data.json").is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    Ok(folders)
}

/// The LiDAR.
fn lidar(options: &Options, body_from_lidar: PoseEntry) -> LidarEntry {
    let model = options.model.unwrap_or(velodyne::Model::Hdl32e.into());
    LidarEntry::new(model.name(), "nuscenes", LIDAR_FOLDER, body_from_lidar)
}
