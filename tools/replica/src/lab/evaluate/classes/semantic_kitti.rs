//! Evaluates a model on labelled sweeps of SemanticKITTI.

use super::point_confusion::{name_of, point_confusion};
use anyhow::Context;
use formats::semantic_kitti::CLASS_OF_BENCHMARK_ID;
use geometry::SphericalGrid;
use messages::ClassId::{self, Fence, GuardRail, Road, RoadLine, Unlabeled, Wall};
use messages::{ClassRow, SubmapHeader, SubmapPoint, SubmapSweep};
use scores::Confusion;
use segmentation::{ModelInput, Segmenter};
use std::path::{Path, PathBuf};

/// Merges classes that the benchmark does not distinguish: road lines are road; walls and guard rails are fences.
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
    /// Name of its file.
    pub name: String,
    /// Sensor frame, m.
    pub points: Vec<[f32; 3]>,
    /// Id of each point.
    pub ids: Vec<u32>,
}

/// All sweeps of a folder, sorted by name.
pub fn labelled_sweeps(folder: &Path) -> anyhow::Result<Vec<LabelledSweep>> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .with_context(|| folder.display().to_string())?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    files.retain(|path| path.to_string_lossy().ends_with(".npy") && name_of(path).contains("_points_"));
    files.sort();
    anyhow::ensure!(!files.is_empty(), "{}: no *_points_*.npy file in this folder", folder.display());
    files.iter().map(|path| labelled_sweep(path)).collect()
}

fn labelled_sweep(path: &Path) -> anyhow::Result<LabelledSweep> {
    let name = name_of(path);
    let labels = path.with_file_name(name.replace("_points_", "_labels_")).with_extension("npy");
    let coordinates: Vec<f32> = read_npy(path)?;
    let points = coordinates.as_chunks::<3>().0.to_vec();
    let ids: Vec<i32> = read_npy(&labels)?;
    let (n_points, n_labels) = (points.len(), ids.len());
    anyhow::ensure!(n_points == n_labels, "{}: {n_labels} labels for {n_points} points", labels.display());
    let last = CLASS_OF_BENCHMARK_ID.len() - 1;
    let checked = |id: i32| u32::try_from(id).ok().filter(|&id| id as usize <= last);
    let ids: Option<Vec<u32>> = ids.into_iter().map(checked).collect();
    let ids = ids.with_context(|| format!("{}: ids must be 0 to {last}", labels.display()))?;
    Ok(LabelledSweep { name, points, ids })
}

/// The confusion matrix of each sweep.
pub fn confusions(model: &dyn Segmenter, folder: &Path) -> anyhow::Result<Vec<(String, Confusion)>> {
    labelled_sweeps(folder)?.iter().map(|sweep| Ok((sweep.name.clone(), confusion(model, sweep)?))).collect()
}

fn confusion(model: &dyn Segmenter, sweep: &LabelledSweep) -> anyhow::Result<Confusion> {
    let (header, rows) = submap(&sweep.points);
    let mut classes = vec![ClassRow::default(); rows.len()];
    model.segment(&ModelInput::new(&header, &rows), &mut classes)?;
    let truth: Vec<u8> = sweep.ids.iter().map(|&id| CLASS_OF_BENCHMARK_ID[id as usize] as u8).collect();
    let predicted: Vec<u8> = classes.iter().map(|row| as_labelled(row.class_id)).collect();
    Ok(point_confusion(&truth, &predicted, |class| class != Unlabeled as u8))
}

/// Converts a sweep to a submap. Ring and azimuth come from the spherical projection.
fn submap(points: &[[f32; 3]]) -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let row = |xyz: &[f32; 3]| {
        // Points slightly outside the range of elevations belong to the outermost lasers.
        let [x, y, z] = *xyz;
        let flat = (x * x + y * y).sqrt();
        let elevation = z.atan2(flat).clamp(GRID.down + 1e-4, GRID.up - 1e-4);
        let (ring_row, column) = GRID.pixel([x, y, flat * elevation.tan()]).unwrap_or((GRID.rows - 1, 0));
        SubmapPoint {
            x,
            y,
            z,
            // Columns of the projection count counter-clockwise, azimuths clockwise.
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

/// The numbers of a `.npy` file in C order.
fn read_npy<T: npyz::Deserialize>(path: &Path) -> anyhow::Result<Vec<T>> {
    let about = || path.display().to_string();
    let bytes = std::fs::read(path).with_context(about)?;
    formats::npy::check_header(&bytes).with_context(about)?;
    let file = npyz::NpyFile::new(&bytes[..]).with_context(about)?;
    anyhow::ensure!(file.order() == npyz::Order::C, "{}: Fortran order; must be C order", path.display());
    file.into_vec().with_context(about)
}
