//! Sweeps as rows of x y z intensity with a label each.

use crate::evaluate::classes::folder::sorted_entries;
use crate::evaluate::classes::labelled_submap::LabelledSubmap;
use crate::evaluate::classes::labels::Labels;
use crate::evaluate::classes::semantic_kitti;
use anyhow::{Context, ensure};
use files::regular_file;
use formats::kitti::{labels_from_bytes, points_from_bin};
use messages::{SubmapHeader, SubmapPoint};
use std::path::{Path, PathBuf};

/// Azimuths beyond this, deg to each side, belong to a LiDAR that turns.
const TURNING_DEG: f32 = 90.0;

/// The sweeps with labels of a data set: of its folder, or of its subfolders, which are places of one sensor.
pub fn find(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let own = labelled(folder)?;
    if !own.is_empty() {
        return Ok(own);
    }
    let mut found = Vec::new();
    for place in super::subfolders(folder)? {
        found.extend(labelled(&place)?);
    }
    Ok(found)
}

/// The `*.bin` files of a folder with a `*.label` of the same name.
pub fn labelled(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths = sorted_entries(folder)?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "bin"));
    paths.retain(|path| path.with_extension("label").is_file());
    Ok(paths)
}

/// Reads sweeps of one data set.
pub fn read(paths: &[PathBuf]) -> anyhow::Result<(Labels, Vec<LabelledSubmap>)> {
    let mut ids = Vec::new();
    for path in paths {
        let path = path.with_extension("label");
        let about = || path.display().to_string();
        let labels = labels_from_bytes(&regular_file::read(&path).with_context(about)?).with_context(about)?;
        ids.push(labels.into_iter().map(|label| label.class).collect::<Vec<u16>>());
    }
    let mut known = ids.concat();
    known.sort_unstable();
    known.dedup();
    let folder = paths.first().and_then(|path| path.parent()).unwrap_or(Path::new(""));
    let labels = Labels::from_ids(&known).with_context(|| {
        format!("{}: the ids {known:?} are of neither SemanticKITTI nor RELLIS-3D", folder.display())
    })?;
    let submaps = paths.iter().zip(&ids).map(|(path, ids)| submap(path, ids, labels)).collect::<anyhow::Result<_>>()?;
    Ok((labels, submaps))
}

/// A sweep as a submap. The beams of a turning LiDAR of `SemanticKITTI` are found by its projection; other sweeps have no rings, and
/// their rows are elevations. Points at the origin are not returns.
fn submap(path: &Path, ids: &[u16], labels: Labels) -> anyhow::Result<LabelledSubmap> {
    let about = || path.display().to_string();
    let cloud = points_from_bin(&regular_file::read(path).with_context(about)?).with_context(about)?;
    ensure!(cloud.len() == ids.len(), "{}: {} points, but {} labels", about(), cloud.len(), ids.len());
    let returns = || cloud.iter().filter(|point| point.x.abs() + point.y.abs() + point.z.abs() > 0.0);
    let is_turning = returns().any(|point| point.y.atan2(point.x).to_degrees().abs() > TURNING_DEG);
    let has_rings = labels == Labels::SemanticKitti && is_turning;
    // Reflectances of 0 to 1 become 0 to 255, as in an import.
    let brightest = returns().map(|point| point.intensity).fold(0.0, f32::max);
    let scale = if brightest <= 1.0 { 255.0 } else { 1.0 };
    let mut points = Vec::new();
    let mut truth = Vec::new();
    for (point, id) in cloud.iter().zip(ids) {
        let xyz = [point.x, point.y, point.z];
        if xyz == [0.0; 3] {
            continue;
        }
        let intensity = (scale * point.intensity).round().clamp(0.0, 255.0) as u8;
        points.push(if has_rings { semantic_kitti::row(xyz, intensity) } else { without_ring(xyz, intensity) });
        truth.push(labels.truth(*id));
    }
    let header = SubmapHeader::one_sweep(points.len(), if has_rings { semantic_kitti::GRID.rows } else { 0 });
    Ok(LabelledSubmap { header, points, truth })
}

fn without_ring([x, y, z]: [f32; 3], intensity: u8) -> SubmapPoint {
    let flat = (x * x + y * y).sqrt();
    // Azimuths count clockwise.
    let azimuth = ((-y).atan2(x).to_degrees().rem_euclid(360.0) * 100.0) as u16;
    let elevation = (z.atan2(flat).to_degrees() * 100.0).round() as i16;
    SubmapPoint { x, y, z, azimuth: azimuth.min(35_999), elevation, intensity, ..SubmapPoint::default() }
}
