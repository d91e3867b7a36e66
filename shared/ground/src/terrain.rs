//! From elevation to terrain: zones, ground zones, and heights between them.

use crate::elevation::Elevation;
use crate::parameters::{Parameters, Settings};
use morphology::{closing, fill_gaps, limit_rise, opening, quasi_flat_zones_over_gaps};
use ndarray::{Array2, Zip, s};

/// Least share of low cells of a ground zone. Not all cells must be low because the border of a zone may touch objects.
const MIN_LOW_SHARE: f64 = 0.5;

/// Pits of up to twice this width, cells, are closed before the opening.
const STRAY_CELLS: usize = 1;

/// Height of the ground in every cell, m, in raster order, plus one element at infinity for points outside the grid.
/// `None` if there is no ground.
pub(crate) fn terrain(elevation: &Elevation, parameters: &Parameters) -> Option<Vec<f32>> {
    let measured = elevation.lowest_m.mapv(f32::is_finite);
    let low = low_cells(elevation, &measured, parameters)?;
    let ground = ground_cells(elevation, &measured, &low, parameters);
    let (mut heights, _) = fill_gaps(&elevation.lowest_m, &ground)?.into_raw_vec_and_offset();
    heights.push(f32::INFINITY);
    Some(heights)
}

/// Cells whose lowest point is at most `low_m` above the opening of the elevation.
fn low_cells(elevation: &Elevation, measured: &Array2<bool>, parameters: &Parameters) -> Option<Array2<bool>> {
    let surface = fill_gaps(&elevation.lowest_m, measured)?;
    let radius = (0.5 * parameters.settings.window_m / elevation.grid.cell_m).round() as usize;
    // A point below the ground (a reflection in a car or puddle) would lower every window that contains it.
    let opened = opening_with_padding(&closing(&surface, STRAY_CELLS), radius);
    let low_m = parameters.settings.low_m as f32;
    let is_low = |&surface: &f32, &opened: &f32, &measured: &bool| measured && surface - opened <= low_m;
    Some(Zip::from(&surface).and(&opened).and(measured).map_collect(is_low))
}

/// An opening whose windows may extend beyond the image. Clipped windows would lower the upper end of a slope.
fn opening_with_padding(image: &Array2<f32>, radius: usize) -> Array2<f32> {
    let (rows, cols) = image.dim();
    let mut padded = Array2::from_elem((rows + 2 * radius, cols + 2 * radius), f32::INFINITY);
    let inner = s![radius..radius + rows, radius..radius + cols];
    padded.slice_mut(inner).assign(image);
    opening(&padded, radius).slice(inner).to_owned()
}

/// Low cells of the ground zones.
fn ground_cells(
    elevation: &Elevation,
    measured: &Array2<bool>,
    low: &Array2<bool>,
    parameters: &Parameters,
) -> Array2<bool> {
    let settings = &parameters.settings;
    let steps_m = parameters.steps_of_cells(elevation.coarsened(settings));
    let zones = quasi_flat_zones_over_gaps(&elevation.lowest_m, measured, &steps_m);
    let cells_of = |is: &Array2<bool>| {
        let mut n = vec![0_usize; zones.n() + 1];
        zones.image.iter().zip(is).for_each(|(&zone, &is)| n[zone as usize] += usize::from(is));
        n
    };
    let n_low = cells_of(low);
    let min_area = settings.min_zone_m2 / (elevation.grid.cell_m * elevation.grid.cell_m);
    let is_large_and_low = |&zone: &usize| {
        let area = zones.area(zone as u32) as f64;
        area >= min_area && n_low[zone] as f64 >= MIN_LOW_SHARE * area
    };
    let mut ground: Vec<usize> = (1..=zones.n()).filter(is_large_and_low).collect();
    if let Some(largest) = ground.iter().copied().max_by_key(|&zone| n_low[zone]) {
        let largest = Zip::from(&zones.image).and(low).map_collect(|&zone, &low| low && zone as usize == largest);
        let n_high = cells_of(&high_cells(elevation, low, &largest, settings));
        ground.retain(|&zone| 2 * n_high[zone] <= n_low[zone]);
    }
    let mut is_ground = vec![false; zones.n() + 1];
    for zone in ground {
        is_ground[zone] = true;
    }
    Zip::from(&zones.image).and(low).map_collect(|&zone, &low| low && is_ground[zone as usize])
}

/// Low cells above all ground that rises from the `largest` zone. A roof is low if the ground around it is not visible.
fn high_cells(elevation: &Elevation, low: &Array2<bool>, largest: &Array2<bool>, settings: &Settings) -> Array2<bool> {
    let sure = Zip::from(&elevation.lowest_m).and(largest).map_collect(|&z, &is| if is { z } else { f32::INFINITY });
    let reached = limit_rise(&sure, (settings.slope * elevation.grid.cell_m) as f32);
    let low_m = settings.low_m as f32;
    Zip::from(&elevation.lowest_m).and(&reached).and(low).map_collect(|&z, &reached, &low| low && z - reached > low_m)
}
