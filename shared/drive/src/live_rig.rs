//! The mounting of the sensors of a live run.

use super::{MANIFEST_FILE, read_manifest};
use crate::manifest::Manifest;
use files::problems::FileError;
use std::fmt;
use std::path::{Path, PathBuf};

/// Source of the mounting of a live LiDAR. The files named in a manifest are not checked.
#[derive(Clone, Debug)]
pub enum LiveRig {
    /// A manifest.
    File(PathBuf, Box<Manifest>),
    /// The folder of a simulated drive, whose vehicle is not the live one: the default rig is used.
    Simulated(PathBuf),
    /// No manifest is named: the default rig is used.
    Default,
}

impl LiveRig {
    /// Finds the rig of a manifest or a drive folder. The manifest of a simulated drive is used only if `path` is the
    /// file itself.
    pub fn find(path: &Path) -> Result<Self, FileError> {
        if path.is_file() {
            return Ok(Self::File(path.to_owned(), Box::new(read_manifest(path)?)));
        }
        let file = path.join(MANIFEST_FILE);
        if path.as_os_str().is_empty() || !file.exists() {
            return Ok(Self::Default);
        }
        let manifest = Box::new(read_manifest(&file)?);
        Ok(if manifest.truth.is_some() { Self::Simulated(path.to_owned()) } else { Self::File(file, manifest) })
    }

    /// The manifest. `None` for the default rig: the LiDAR is upright at the origin of the body frame.
    pub fn manifest(&self) -> Option<&Manifest> {
        match self {
            Self::File(_, manifest) => Some(manifest),
            Self::Simulated(_) | Self::Default => None,
        }
    }
}

impl fmt::Display for LiveRig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let default = "the LiDAR is assumed upright, with the axes of the body frame; set run.rig to the drive.toml of the vehicle";
        match self {
            Self::File(path, _) => write!(f, "rig: {}", path.display()),
            Self::Simulated(path) => {
                write!(f, "rig: {} is a simulated drive and is not used: {default}", path.display())
            }
            Self::Default => write!(f, "rig: none is given: {default}"),
        }
    }
}
