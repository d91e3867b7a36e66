//! The clouds of a path.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};

/// The file itself, or the PLY clouds of a run's output folder, sorted by name. Files of spectra are left out.
pub fn cloud_files(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let clouds = path.join("clouds");
    let folder = if clouds.is_dir() { clouds } else { path.to_owned() };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(|| format!("{}: cannot list the folder", folder.display()))? {
        let file = entry.with_context(|| format!("{}: cannot list the folder", folder.display()))?.path();
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        // A file of spectra repeats points of a cloud. A leading dot marks an unfinished file.
        let is_cloud = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
        if is_cloud && !stem.ends_with("_spectra") && !stem.starts_with('.') {
            files.push(file);
        }
    }
    files.sort();
    ensure!(!files.is_empty(), "{}: no clouds (*.ply) in this folder", folder.display());
    Ok(files)
}
