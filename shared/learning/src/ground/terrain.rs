//! From elevation to terrain: zones, which of them are ground, and the heights between them.

use super::Parameters;
use super::elevation::Elevation;
use crate::LearningError;
use candle_core::{Device, Tensor};
use morphology::{closing, fill_gaps, opening, quasi_flat_zones_over_gaps};
use ndarray::{Array2, s};

/// Share of a zone's cells that must lie low for it to be ground: most, since a zone's edge may touch what stands on it.
const MIN_LOW_SHARE: f64 = 0.5;

/// Pits of up to twice this many cells across are no ground that the opening has to reach.
const STRAY_CELLS: usize = 1;

/// Height of the ground in every cell, m, in raster order, and one element more: infinite, for points outside the grid.
/// `None` if there is no ground.
pub(super) fn terrain(elevation: &Elevation, parameters: &Parameters) -> Result<Option<Tensor>, LearningError> {
    let measured = elevation.lowest_m.mapv(f32::is_finite);
    let Some(low) = low_cells(elevation, &measured, parameters) else { return Ok(None) };
    let ground = ground_cells(elevation, &measured, &low, parameters);
    let Some(heights) = fill_gaps(&elevation.lowest_m, &ground) else { return Ok(None) };
    let (mut heights, _) = heights.into_raw_vec_and_offset();
    heights.push(f32::INFINITY);
    let n = heights.len();
    Ok(Some(Tensor::from_vec(heights, n, &Device::Cpu)?))
}

/// Cells whose lowest point is at most `low_m` above the opening of the elevation.
fn low_cells(elevation: &Elevation, measured: &Array2<bool>, parameters: &Parameters) -> Option<Array2<bool>> {
    let surface = fill_gaps(&elevation.lowest_m, measured)?;
    let radius = (0.5 * parameters.settings.window_m / elevation.grid.cell_m).round() as usize;
    // Points below the ground (reflections in cars and puddles) would pull every window down that holds one.
    let opened = opening_beyond_the_edge(&closing(&surface, STRAY_CELLS), radius);
    let low_m = parameters.settings.low_m as f32;
    let is_low = |&surface: &f32, &opened: &f32, &measured: &bool| measured && surface - opened <= low_m;
    Some(ndarray::Zip::from(&surface).and(&opened).and(measured).map_collect(is_low))
}

/// An opening whose windows may reach over the image's edge. Clipped ones would lower the upper end of a slope.
fn opening_beyond_the_edge(image: &Array2<f32>, radius: usize) -> Array2<f32> {
    let (rows, cols) = image.dim();
    let mut padded = Array2::from_elem((rows + 2 * radius, cols + 2 * radius), f32::INFINITY);
    let inner = s![radius..radius + rows, radius..radius + cols];
    padded.slice_mut(inner).assign(image);
    opening(&padded, radius).slice(inner).to_owned()
}

/// Low cells of the zones that are ground.
fn ground_cells(
    elevation: &Elevation,
    measured: &Array2<bool>,
    low: &Array2<bool>,
    parameters: &Parameters,
) -> Array2<bool> {
    let steps_m = parameters.steps_of_cells(elevation.coarsened(&parameters.settings));
    let zones = quasi_flat_zones_over_gaps(&elevation.lowest_m, measured, &steps_m);
    let mut n_low = vec![0_usize; zones.n() + 1];
    for (&label, &low) in zones.image.iter().zip(low) {
        n_low[label as usize] += usize::from(low);
    }
    let min_area = parameters.settings.min_zone_m2 / (elevation.grid.cell_m * elevation.grid.cell_m);
    let is_ground = |label: u32| {
        let area = zones.area(label) as f64;
        label != 0 && area >= min_area && n_low[label as usize] as f64 >= MIN_LOW_SHARE * area
    };
    let zone_is_ground: Vec<bool> = (0..=zones.n() as u32).map(is_ground).collect();
    ndarray::Zip::from(&zones.image).and(low).map_collect(|&label, &low| low && zone_is_ground[label as usize])
}
