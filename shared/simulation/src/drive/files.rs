//! Files of a drive that is being made.

use crate::error::SimulationError;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Good enough that no block edge is stronger than the sensor's own texture.
const JPEG_QUALITY: u8 = 88;

/// A folder beside the drive's place; it takes that place when it is complete, and goes if it is given up. So a failed run leaves
/// nothing, and a killed one no half drive.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    is_complete: bool,
}

impl Folder {
    /// Starts anew; what a cut run left there goes.
    pub fn beside(out: &Path) -> Result<Self, SimulationError> {
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
    /// Path of a file inside; its folder is made.
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
    /// Writes an sRGB picture.
    pub fn write_jpeg(&self, name: &str, pixels: &[u8], (width, height): (u32, u32)) -> Result<(), SimulationError> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .encode(pixels, width, height, ExtendedColorType::Rgb8)
            .map_err(|cause| SimulationError::Image { path: self.path.join(name), cause })?;
        self.write(name, &bytes)
    }
    /// The drive is complete.
    pub fn complete(mut self, out: &Path) -> Result<(), SimulationError> {
        fs::rename(&self.path, out).map_err(SimulationError::write(out))?;
        self.is_complete = true;
        Ok(())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.is_complete {
            // The error that is on its way says what went wrong; what cannot be removed either, the next run removes.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}
