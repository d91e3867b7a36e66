//! Converts the calibration file of a Ladybug to camera entries of a `drive.toml`.

use anyhow::Context;
use formats::ladybug::LadybugCalibration;
use formats::manifest::CameraEntry;
use geometry::{CameraModel, Translation3};
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct Cameras {
    camera: Vec<CameraEntry>,
}

/// Writes `[[camera]]` entries and returns their number. `position` is that of the housing in the body frame, m; the axes are
/// parallel.
pub fn import(source: &Path, out: &Path, position: [f64; 3]) -> anyhow::Result<usize> {
    let text = std::fs::read_to_string(source).with_context(|| source.display().to_string())?;
    let calibration: LadybugCalibration = text.parse().with_context(|| source.display().to_string())?;
    let body_from_ladybug = Translation3::from(position);
    let entry = |(index, camera): (usize, formats::ladybug::LadybugCamera)| CameraEntry {
        name: format!("ladybug_{index}"),
        folder: format!("camera/ladybug_{index}"),
        // A placeholder: the calibration file has no exposure time.
        exposure_nanos: 2_000_000,
        body_from_camera: (body_from_ladybug * camera.ladybug_from_camera).into(),
        model: CameraModel::SplineWarp(camera.lens),
    };
    let camera: Vec<CameraEntry> = calibration.cameras.into_iter().enumerate().map(entry).collect();
    let n_cameras = camera.len();
    let head = format!("# Ladybug {}, from {}\n\n", calibration.serial, source.display());
    std::fs::write(out, head + &toml::to_string(&Cameras { camera })?).with_context(|| out.display().to_string())?;
    Ok(n_cameras)
}
