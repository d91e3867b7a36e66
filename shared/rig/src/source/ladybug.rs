//! The factory calibration of a Ladybug.

use super::{CameraPart, RigParts, SourceOptions};
use crate::error::RigError;
use formats::ladybug::LadybugCalibration;
use geometry::{CameraModel, Pose};
use std::path::Path;

pub(super) fn read(path: &Path, text: &str, options: &SourceOptions) -> Result<RigParts, RigError> {
    let found: LadybugCalibration =
        text.parse().map_err(|error: formats::ladybug::LadybugError| RigError::source(path, "", error.to_string()))?;
    let body_from_ladybug = options.body_from_source.unwrap_or_else(Pose::identity);
    let note = format!(
        "Ladybug {}: {} cameras; frame of the source: the housing, x forward through camera 0, z up",
        found.serial,
        found.cameras.len()
    );
    let cameras = found.cameras.into_iter().enumerate().map(|(index, camera)| CameraPart {
        name: format!("ladybug_{index}"),
        frame: None,
        body_from_camera: Some(body_from_ladybug * camera.ladybug_from_camera),
        model: CameraModel::SplineWarp(camera.lens),
    });
    Ok(RigParts { cameras: cameras.collect(), notes: vec![note], ..RigParts::default() })
}
