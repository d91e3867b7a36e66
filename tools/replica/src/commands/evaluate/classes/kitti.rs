//! Labelled sweeps of SemanticKITTI.

use super::{count, name_of};
use anyhow::Context;
use geometry::SphericalGrid;
use learning::scores::Confusion;
use learning::{Cloud, Segmenter};
use messages::ClassId::{
    self, Building, Fence, Ground, GuardRail, Pedestrian, Pole, Road, RoadLine, Sidewalk, Terrain, TrafficSign,
    Unlabeled, Vegetation, Vehicles, Wall,
};
use messages::{ClassRow, SubmapHeader, SubmapPoint, SubmapSweep};
use std::path::{Path, PathBuf};

/// Ours for the benchmark's 0 to 19: unlabeled; car, bicycle, motorcycle, truck, other vehicle; person, bicyclist,
/// motorcyclist; road, parking; sidewalk; other ground; building; fence; vegetation, trunk; terrain; pole; traffic sign.
const CLASS_OF_ID: [ClassId; 20] = [
    Unlabeled,
    Vehicles,
    Vehicles,
    Vehicles,
    Vehicles,
    Vehicles,
    Pedestrian,
    Pedestrian,
    Pedestrian,
    Road,
    Road,
    Sidewalk,
    Ground,
    Building,
    Fence,
    Vegetation,
    Vegetation,
    Terrain,
    Pole,
    TrafficSign,
];

/// Classes of ours that the benchmark does not tell from another: paint is road; walls and crash barriers are fences there.
fn as_labelled(class: u8) -> u8 {
    match ClassId::from_id(class) {
        Some(RoadLine) => Road as u8,
        Some(Wall | GuardRail) => Fence as u8,
        _ => class,
    }
}

/// The HDL-64E of KITTI, upright 1.73 m above the road.
pub const GRID: SphericalGrid = SphericalGrid { rows: 64, columns: 36_000, up: 0.035, down: -0.436 };

/// A sweep with the benchmark's ids, 0 to 19.
pub struct LabelledSweep {
    /// Of its file.
    pub name: String,
    /// Sensor frame, m.
    pub points: Vec<[f32; 3]>,
    /// By point.
    pub ids: Vec<u32>,
}

/// All sweeps of a folder, by name.
pub fn labelled_sweeps(folder: &Path) -> anyhow::Result<Vec<LabelledSweep>> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| folder.display().to_string())?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    files.retain(|path| path.to_string_lossy().ends_with(".npy") && name_of(path).contains("_points_"));
    files.sort();
    anyhow::ensure!(!files.is_empty(), "{}: no *_points_*.npy", folder.display());
    files.iter().map(|path| labelled_sweep(path)).collect()
}

fn labelled_sweep(path: &Path) -> anyhow::Result<LabelledSweep> {
    let name = name_of(path);
    let labels = path.with_file_name(name.replace("_points_", "_labels_")).with_extension("npy");
    let coordinates: Vec<f32> = words(path)?.into_iter().map(f32::from_le_bytes).collect();
    let ids: Vec<u32> = words(&labels)?.into_iter().map(u32::from_le_bytes).collect();
    anyhow::ensure!(coordinates.len() == 3 * ids.len(), "{}: {} labels", labels.display(), ids.len());
    let last = CLASS_OF_ID.len() as u32 - 1;
    anyhow::ensure!(ids.iter().all(|&id| id <= last), "{}: ids must be 0 to {last}", labels.display());
    Ok(LabelledSweep { name, points: coordinates.as_chunks::<3>().0.to_vec(), ids })
}

/// Confusion of each sweep.
pub fn confusions(model: &dyn Segmenter, folder: &Path) -> anyhow::Result<Vec<(String, Confusion)>> {
    labelled_sweeps(folder)?.iter().map(|sweep| Ok((sweep.name.clone(), confusion(model, sweep)?))).collect()
}

fn confusion(model: &dyn Segmenter, sweep: &LabelledSweep) -> anyhow::Result<Confusion> {
    let (header, rows) = submap(&sweep.points);
    let mut classes = vec![ClassRow::default(); rows.len()];
    model.segment(&Cloud { header: &header, points: &rows, colors: None }, &mut classes)?;
    let truth: Vec<u8> = sweep.ids.iter().map(|&id| CLASS_OF_ID[id as usize] as u8).collect();
    let predicted: Vec<u8> = classes.iter().map(|row| as_labelled(row.class_id)).collect();
    Ok(count(&truth, &predicted, |class| class != Unlabeled as u8))
}

/// The sweep as a submap: laser and encoder angle by the spherical projection.
fn submap(points: &[[f32; 3]]) -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let row = |xyz: &[f32; 3]| {
        // Points a little outside the elevations belong to the outermost lasers.
        let [x, y, z] = *xyz;
        let flat = (x * x + y * y).sqrt();
        let elevation = z.atan2(flat).clamp(GRID.down + 1e-4, GRID.up - 1e-4);
        let (ring_row, column) = GRID.pixel([x, y, flat * elevation.tan()]).unwrap_or((GRID.rows - 1, 0));
        SubmapPoint {
            x,
            y,
            z,
            // The formula's columns count to the left, the encoder to the right.
            azimuth: (35_999 - column) as u16,
            ring: (GRID.rows - 1 - ring_row) as u8,
            ..SubmapPoint::default()
        }
    };
    let rows: Vec<SubmapPoint> = points.iter().map(row).collect();
    let mut header: Box<SubmapHeader> = Box::default();
    (header.n_rings, header.n_sweeps) = (GRID.rows as u32, 1);
    let here = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    header.sweeps[0] = SubmapSweep {
        n_points: rows.len() as u32,
        duration_nanos: 100_000_000,
        submap_from_lidar_begin: here,
        submap_from_lidar_end: here,
        ..SubmapSweep::default()
    };
    (header, rows)
}

/// The 4-byte numbers of a little-endian, C-ordered `.npy` file, version 1.
fn words(path: &Path) -> anyhow::Result<Vec<[u8; 4]>> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let length = bytes.get(8..10).map(|b| usize::from(b[0]) | usize::from(b[1]) << 8);
    let data = length.filter(|_| bytes.starts_with(b"\x93NUMPY\x01\x00")).and_then(|length| bytes.get(10 + length..));
    let data = data.with_context(|| format!("{}: no .npy file of version 1", path.display()))?;
    Ok(data.as_chunks::<4>().0.to_vec())
}
