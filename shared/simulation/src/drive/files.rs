//! The folder of a drive during writing.

use crate::error::SimulationError;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// JPEG quality: block edges are weaker than sensor noise.
const JPEG_QUALITY: u8 = 88;

/// A folder `OUT.partial` next to the output. It is renamed to the output when complete and removed when dropped earlier,
/// so that a failed run leaves no files and a killed run leaves no incomplete drive.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    is_complete: bool,
}

impl Folder {
    /// Creates the folder; removes the remains of an interrupted run.
    pub fn next_to(out: &Path) -> Result<Self, SimulationError> {
        let mut name = out.file_name().map_or_else(|| OsString::from("drive"), OsString::from);
        name.push(".partial");
        let path = out.with_file_name(name);
        match fs::remove_dir_all(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(SimulationError::write(&path)(error));
            }
            _ => {}
        }
        fs::create_dir_all(&path).map_err(SimulationError::write(&path))?;
        Ok(Self { path, is_complete: false })
    }
    /// Path of a file inside; creates its folder.
    pub fn path(&self, name: &str) -> Result<PathBuf, SimulationError> {
        let path = self.path.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(SimulationError::write(parent))?;
        }
        Ok(path)
    }
    /// Writes a file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SimulationError> {
        let path = self.path(name)?;
        fs::write(&path, bytes).map_err(SimulationError::write(&path))
    }
    /// Writes an sRGB image.
    pub fn write_jpeg(&self, name: &str, pixels: &[u8], [width, height]: [u32; 2]) -> Result<(), SimulationError> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .encode(pixels, width, height, ExtendedColorType::Rgb8)
            .map_err(|cause| SimulationError::Image { path: self.path.join(name), cause })?;
        self.write(name, &bytes)
    }
    /// Syncs the complete drive and renames it to `out`. After a power loss, no drive of this name has empty files.
    pub fn complete(mut self, out: &Path) -> Result<(), SimulationError> {
        sync_all(&self.path)?;
        fs::rename(&self.path, out).map_err(SimulationError::write(out))?;
        self.is_complete = true;
        match out.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => sync(parent),
            _ => sync(Path::new(".")),
        }
    }
}

/// Syncs everything in a folder, then the folder.
fn sync_all(folder: &Path) -> Result<(), SimulationError> {
    for entry in fs::read_dir(folder).map_err(SimulationError::write(folder))? {
        let entry = entry.map_err(SimulationError::write(folder))?;
        let path = entry.path();
        let kind = entry.file_type().map_err(SimulationError::write(&path))?;
        if kind.is_dir() { sync_all(&path)? } else { sync(&path)? }
    }
    sync(folder)
}

fn sync(path: &Path) -> Result<(), SimulationError> {
    fs::File::open(path).and_then(|file| file.sync_all()).map_err(SimulationError::write(path))
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.is_complete {
            // The original error is reported; the next run removes the remains.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}
