//! Calibration files of mosaic cameras.

use anyhow::Context;
use files::regular_file;
use formats::sensor_calibration::SensorCalibration;
use std::path::Path;

/// Reads the manufacturer's XML file of a mosaic camera.
pub fn read(path: &Path) -> anyhow::Result<SensorCalibration> {
    let text = regular_file::read_to_string(path).with_context(|| path.display().to_string())?;
    SensorCalibration::from_xml(&text).with_context(|| path.display().to_string())
}
