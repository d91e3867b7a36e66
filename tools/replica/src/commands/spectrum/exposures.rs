//! The same street at other exposure times (thesis 4.3.1, figure 4.13): drives that are simulated to be compared.

use anyhow::{Context, ensure};
use simulation::{DriveSpec, write_drive};
use std::path::{Path, PathBuf};

/// Long enough for four frames at one a second.
const SECONDS: f64 = 4.2;

/// Drives in `folder`, by exposure: of all mosaic cameras, or of the one named.
pub fn simulate(folder: &Path, exposures_ms: &[f64], seed: u64, camera: Option<&str>) -> anyhow::Result<Vec<PathBuf>> {
    // Nobody looks at colors and points.
    let mut spec = DriveSpec { cameras: false, lidar_step: 100, ..DriveSpec::urban(seed, SECONDS) };
    if let Some(name) = camera {
        spec.rig.mosaics.retain(|mosaic| mosaic.name == name);
        ensure!(!spec.rig.mosaics.is_empty(), "{name} is no mosaic camera of the simulated vehicle");
    }
    let drive = |ms: &f64| {
        let out = folder.join(format!("{ms} ms"));
        let spec = DriveSpec { mosaic_exposure_nanos: (ms * 1e6).round() as u64, ..spec.clone() };
        write_drive(&spec, &out, &mut |_| {}).with_context(|| format!("simulating an exposure of {ms} ms"))?;
        Ok(out)
    };
    exposures_ms.iter().map(drive).collect()
}
