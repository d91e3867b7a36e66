//! Lists the files of a data set that are not imported.

use crate::Kind;
use crate::error::{At, ImportError};
use crate::files::files;
use crate::plan::Plan;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Levels of folders below the source that are listed: KITTI raw and nuScenes have images at the second level.
const MAX_DEPTH: usize = 3;
/// Single files beyond this number are counted, not named.
const MAX_NAMED: usize = 8;

/// One line per folder with files that are not imported, and one per single file.
pub(crate) fn list(source: &Path, found: &Plan) -> Result<Vec<String>, ImportError> {
    let mut taken: BTreeSet<PathBuf> = found.links.iter().map(|link| link.original.clone()).collect();
    for path in found.read.iter().chain(found.conversions.iter().flat_map(|conversion| &conversion.originals)) {
        taken.insert(path.canonicalize().at(path)?);
    }
    let mut folders = BTreeMap::new();
    if source.is_dir() {
        count(source, 0, &taken, &mut folders)?;
    }
    let mut lines: Vec<String> = Vec::new();
    for (folder, names) in &folders {
        let shown = folder.strip_prefix(source).unwrap_or(folder);
        if folder == source && names.len() <= MAX_NAMED {
            lines.extend(names.iter().map(|name| format!("not imported: {name}{}", meaning(Path::new(name)))));
        } else {
            let place = if folder == source { String::new() } else { format!(" in {}", shown.display()) };
            let files = if names.len() == 1 { "file" } else { "files" };
            lines.push(format!("not imported: {} {files}{place}{}", names.len(), meaning(shown)));
        }
    }
    // KITTI raw keeps the calibration of a day next to its drives.
    if let (Kind::KittiRaw, Some(parent)) = (found.kind, source.canonicalize().at(source)?.parent()) {
        let is_left = |(name, path): &&(String, PathBuf)| name.starts_with("calib") && !taken.contains(path);
        for (name, _) in files(parent, ".txt")?.iter().filter(is_left) {
            lines.push(format!("not imported: ../{name}{}", meaning(Path::new(name))));
        }
    }
    Ok(lines)
}

/// Names of the files of each folder that are not imported.
fn count(
    folder: &Path,
    depth: usize,
    taken: &BTreeSet<PathBuf>,
    folders: &mut BTreeMap<PathBuf, Vec<String>>,
) -> Result<(), ImportError> {
    for entry in folder.read_dir().at(folder)? {
        let path = entry.at(folder)?.path();
        if path.is_dir() {
            if depth < MAX_DEPTH {
                count(&path, depth + 1, taken, folders)?;
            }
        } else if !path.canonicalize().is_ok_and(|path| taken.contains(&path)) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            folders.entry(folder.to_owned()).or_default().push(name);
        }
    }
    folders.entry(folder.to_owned()).and_modify(|names| names.sort());
    Ok(())
}

/// Content of a file or folder of the known data sets.
fn meaning(path: &Path) -> &'static str {
    let name = path.to_string_lossy().to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    if has(&["image", "cam_"]) {
        " (camera images)"
    } else if has(&["oxts", "applanix"]) {
        " (GNSS and IMU)"
    } else if has(&["calib"]) {
        " (calibration)"
    } else if has(&["radar"]) {
        " (radar)"
    } else if has(&["label", "lidarseg", "panoptic", "tracklet"]) {
        " (labels)"
    } else if has(&["poses"]) {
        " (poses)"
    } else if has(&["lidar_top", "velodyne"]) {
        " (other LiDAR files)"
    } else {
        ""
    }
}
