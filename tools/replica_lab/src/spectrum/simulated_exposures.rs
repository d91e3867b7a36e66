//! Simulates one street with several exposure times (thesis section 4.3.1, figure 4.13).

use anyhow::{Context, ensure};
use simulation::{DriveSpec, write_drive};
use std::path::{Path, PathBuf};

/// Long enough for four frames at one per second.
const SECONDS: f64 = 4.2;

/// Simulates one drive per exposure time into `folder`, with all mosaic cameras or with the one called `camera`.
pub fn simulate(folder: &Path, exposures_ms: &[f64], seed: u64, camera: Option<&str>) -> anyhow::Result<Vec<PathBuf>> {
    // Colors and points are not used.
    let mut spec = DriveSpec { cameras: false, lidar_step: 100, ..DriveSpec::urban(seed, SECONDS) };
    if let Some(name) = camera {
        spec.rig.mosaics.retain(|mosaic| mosaic.name == name);
        ensure!(
            !spec.rig.mosaics.is_empty(),
            "--camera {name}: the simulated vehicle has no mosaic camera of this name"
        );
    }
    let drive = |ms: &f64| {
        let out = folder.join(format!("{ms} ms"));
        let spec = DriveSpec { mosaic_exposure_nanos: (ms * 1e6).round() as u64, ..spec.clone() };
        write_drive(&spec, &out, &mut |_| {}).with_context(|| format!("cannot simulate an exposure of {ms} ms"))?;
        Ok(out)
    };
    exposures_ms.iter().map(drive).collect()
}
