//! The output folder.

#![allow(clippy::disallowed_methods, reason = "the purpose of the crate is to write files")]

use crate::error::DeliveryError;
use crate::frame::is_placed;
use crate::index::CloudEntry;
use files::atomic_file::write_atomic;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Folder of the clouds.
pub const CLOUDS: &str = "clouds";
/// File with the list of clouds.
pub const INDEX: &str = "clouds/index.json";
/// File that describes the frame of the results.
pub const GEOREFERENCE: &str = "georeference.json";

/// Files that are written at the end of the run.
const FINAL_FILES: [&str; 5] = [INDEX, GEOREFERENCE, "trajectory.txt", "trajectory_kitti.txt", "trajectory.csv"];

/// The output folder of the run.
pub struct Folder(PathBuf);

impl Folder {
    /// The folder, which is created with the first cloud.
    pub fn new(output: &Path) -> Self {
        Self(output.to_owned())
    }

    /// Path of a file. `name` is relative to the output folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a whole file atomically. `name` is relative to the output folder.
    pub fn write_text(&self, name: &str, text: &str) -> Result<(), DeliveryError> {
        let path = self.path(name);
        write_atomic(&path, text.as_bytes()).map_err(fault(&path, "write"))
    }

    /// Paths of all files of these clouds.
    pub fn files<'a>(&'a self, clouds: &'a [CloudEntry]) -> impl Iterator<Item = PathBuf> + 'a {
        clouds.iter().flat_map(CloudEntry::files).map(|(name, ..)| self.path(name))
    }

    /// Removes all files that this crate writes, except these clouds, which must exist. Other files are kept.
    pub fn keep_only(&self, clouds: &[CloudEntry]) -> Result<(), DeliveryError> {
        let folder = self.path(CLOUDS);
        if !folder.is_dir() {
            fs::create_dir_all(&folder).map_err(fault(&folder, "create"))?;
            // A power loss must not lose the folder with clouds that a saved state lists.
            fs::File::open(&self.0).and_then(|output| output.sync_all()).map_err(fault(&folder, "sync"))?;
        }
        let kept: Vec<(&str, u64, u64)> = clouds.iter().flat_map(CloudEntry::files).collect();
        for entry in fs::read_dir(&folder).map_err(fault(&folder, "list"))? {
            let name = entry.map_err(fault(&folder, "list"))?.file_name();
            let name = name.to_string_lossy();
            if is_cloud(&name) && !kept.iter().any(|(file, ..)| file.strip_prefix("clouds/") == Some(&*name)) {
                remove(&folder.join(&*name))?;
            }
        }
        FINAL_FILES.iter().try_for_each(|name| remove(&self.path(name)))?;
        kept.iter().try_for_each(|(name, size, n_points)| self.check_cloud(name, *size, *n_points))
    }

    /// Checks that a file is the cloud of the saved state, or this cloud in its final frame: the run may have crashed
    /// while it moved clouds.
    fn check_cloud(&self, name: &str, expected: u64, n_points: u64) -> Result<(), DeliveryError> {
        let path = self.path(name);
        let got = fs::metadata(&path).map_err(fault(&path, "get the size"))?.len();
        if got == expected || is_placed(&path, n_points) {
            return Ok(());
        }
        Err(DeliveryError::Changed { path, got, expected })
    }
}

/// Number of the submap whose complete cloud has this name in [`CLOUDS`]. `None` for spectra and other files.
pub fn submap_of(name: &str) -> Option<u64> {
    let digits = name.strip_prefix("submap_")?.strip_suffix(".ply")?;
    digits.parse().ok().filter(|_| is_cloud(name))
}

/// Whether this crate writes files of this name in `clouds/`, complete or partial.
fn is_cloud(name: &str) -> bool {
    let finished = name.strip_prefix('.').and_then(|name| name.strip_suffix(".partial")).unwrap_or(name);
    let seq = finished.strip_prefix("submap_").and_then(|name| name.strip_suffix(".ply"));
    let seq = seq.map(|seq| seq.strip_suffix("_spectra").unwrap_or(seq));
    seq.is_some_and(|seq| seq.len() >= 4 && seq.bytes().all(|byte| byte.is_ascii_digit()))
}

fn remove(path: &Path) -> Result<(), DeliveryError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(fault(path, "remove")(error)),
        _ => Ok(()),
    }
}

fn fault(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> DeliveryError {
    move |source| DeliveryError::File { path: path.to_owned(), action, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_written_names_are_clouds() {
        for name in ["submap_0000.ply", "submap_12345.ply", "submap_0003_spectra.ply", ".submap_0000.ply.partial"] {
            assert!(is_cloud(name), "{name}");
            assert_eq!(submap_of(name).is_some(), name.starts_with("submap_") && !name.contains("spectra"), "{name}");
        }
        for name in ["submap_.ply", "submap_mine.ply", "submap_1.ply", "cloud.ply", "index.json", "submap_0000.las"] {
            assert!(!is_cloud(name), "{name}");
        }
    }
}
