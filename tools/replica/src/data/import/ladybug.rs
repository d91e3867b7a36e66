//! Converts the calibration file of a Ladybug to camera entries of a `drive.toml`.

use anyhow::Context;
use drive::manifest::CameraEntry;
use geometry::Pose;
use rig::source::{FrameTree, SourceOptions, UNKNOWN_EXPOSURE_NANOS, read};
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct Cameras {
    camera: Vec<CameraEntry>,
}

/// Writes `[[camera]]` entries and returns their number. `position` is the position of the housing in the body frame, m; the
/// axes are parallel. `replica rig new` makes a complete `drive.toml`, with any rotation.
pub fn import(source: &Path, out: &Path, [x, y, z]: [f64; 3]) -> anyhow::Result<usize> {
    let options = SourceOptions { body_from_source: Some(Pose::translation(x, y, z)), ..SourceOptions::default() };
    let parts = read(source, &options, &mut FrameTree::default())?;
    let entry = |camera: rig::source::CameraPart| CameraEntry {
        delay_nanos: 0,
        folder: format!("camera/{}", camera.name),
        exposure_nanos: UNKNOWN_EXPOSURE_NANOS,
        body_from_camera: camera.body_from_camera.unwrap_or_else(Pose::identity).into(),
        name: camera.name,
        model: camera.model,
    };
    let camera: Vec<CameraEntry> = parts.cameras.into_iter().map(entry).collect();
    let n_cameras = camera.len();
    let head = format!("# {}, from {}\n\n", parts.notes.join("; "), source.display());
    std::fs::write(out, head + &toml::to_string(&Cameras { camera })?).with_context(|| out.display().to_string())?;
    Ok(n_cameras)
}
