//! Occlusion: a depth buffer for every exposure, computed from the points of the submap.
//!
//! An image is divided into cells of about 0.2 degrees, and each cell keeps the range of its nearest point. LiDAR points
//! are sparser than the cells, especially between rings. Gaps between two near cells are therefore filled up to the width
//! that the spacing of the sensor explains (a morphological closing along rows and columns). Silhouettes keep their
//! position. A point is occluded if its range exceeds a sum of three terms: the nearest range of its cell, a tolerance
//! for noise and poses that grows with range, and the rise of the surface towards the neighboring cells. Without the
//! rise, a road seen at grazing incidence would occlude itself.

use crate::chunk::{CHUNK, Chunk, Lanes, gap, seconds};
use crate::exposure::PosedExposure;
use crate::points::SubmapPoints;
use crate::projection::Projected;
use crate::visibility::{CELL_RAD, CellGrid, VisibilityMap};
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

/// Rings of a spinning LiDAR cover about 40 degrees (HDL-32E: 41), so that they are `RINGS_RAD / n_rings` apart.
const RINGS_RAD: f32 = 0.72;

/// Largest gap along the rings that is filled, cells: three times the spacing of shots, because the camera may be closer
/// to the surface than the LiDAR was.
const GAP_ALONG: usize = 3;

/// Largest gap across the rings that is filled, cells. A larger limit would close windows and the space below cars. An
/// HDL-32E has 7.
const MAX_GAP_ACROSS: usize = 8;

/// A point this far behind the nearest one is still visible, m. The margin covers range noise and pose noise between two
/// shots.
const TOLERANCE_M: f32 = 0.15;

/// Part of the tolerance that grows with range, m/m: a pose error of a quarter of a degree between exposure and shot, on
/// a slanted surface.
const TOLERANCE_PER_M: f32 = 0.01;

/// Largest rise of a surface over one cell per metre of range. At 40 = tan(88.6 degrees), a street seen from 2 m above is
/// still one surface 80 m ahead.
const MAX_RISE: f32 = CELL_RAD * 40.0;

/// Largest time between an exposure and the points that occlude in it, s: a tilted LiDAR needs some metres of travel to
/// cover the whole view of a camera. For an exposure before or after the submap, the first or last points of the submap
/// occlude.
const OCCLUDER_AGE_S: f32 = 1.0;

/// Largest time between an exposure and the occluding points on moving objects, s. It exceeds one revolution, so that a
/// car is complete. The car also occludes the place that it just left: a missing color is better than the color of the
/// car.
const MOVING_OCCLUDER_AGE_S: f32 = 0.3;

/// Factor of the rise over one cell. A point may be at the far end of its cell, and the visible range comes from the
/// nearest neighboring cell. This gives twice the rise, and more, because the range to a street grows faster with
/// distance.
const MAX_RISE_SHARE: f32 = 2.5;

/// The visibility map of every exposure, from points around its time (`OCCLUDER_AGE_S`; `MOVING_OCCLUDER_AGE_S` for points
/// on moving objects).
pub fn visibility_maps(points: &SubmapPoints<'_>, exposures: &[PosedExposure<'_>]) -> Vec<VisibilityMap> {
    let [begin, end] = points.time_span();
    let gap_across = (RINGS_RAD / points.fewest_rings().max(1) as f32 / CELL_RAD).ceil().max(1.0) as usize;
    let of_task = |scratch: &mut Scratch, exposures: &[PosedExposure<'_>]| -> Vec<VisibilityMap> {
        let mut buffers: Vec<DepthBuffer> = exposures.iter().map(DepthBuffer::new).collect();
        for chunk in points.occluders() {
            for (exposure, buffer) in exposures.iter().zip(&mut buffers) {
                let time = seconds(exposure.stamp, points.origin);
                let occludes = gap(time.max(begin).min(end), chunk.time_span) <= OCCLUDER_AGE_S;
                if occludes && exposure.frustum.intersects(&chunk.bounds) {
                    buffer.add(exposure, chunk, scratch, time);
                }
            }
        }
        let pairs = buffers.into_iter().zip(exposures);
        pairs.map(|(buffer, exposure)| buffer.visibility(exposure, gap_across.min(MAX_GAP_ACROSS))).collect()
    };
    exposures.par_chunks(EXPOSURES_PER_TASK).map_init(Scratch::default, of_task).flatten_iter().collect()
}

/// Exposures that are processed together: exposures of one time share a chunk while it is in the cache. A larger number
/// would leave threads idle.
const EXPOSURES_PER_TASK: usize = 3;

/// Buffers that are reused for every chunk.
#[derive(Default)]
struct Scratch {
    projected: Projected,
    hits: Hits,
}

/// Cell and range of every point of a chunk.
struct Hits {
    cells: Lanes<u32>,
    /// Infinite for a point that does not occlude.
    range_m: Lanes<f32>,
}

impl Default for Hits {
    fn default() -> Self {
        Self { cells: [0; CHUNK], range_m: [0.0; CHUNK] }
    }
}

/// Finds the cells of the points that occlude.
struct FindHits<'a> {
    /// Time of the exposure, s after the submap's first shot.
    time: f32,
    exposure: PosedExposure<'a>,
    grid: CellGrid,
    chunk: &'a Chunk,
    projected: &'a Projected,
    hits: &'a mut Hits,
}

impl NullaryFnOnce for FindHits<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { time, exposure, grid, chunk, projected, hits } = self;
        for i in 0..chunk.n_lanes() {
            let u = projected.u[i];
            let v = projected.v[i];
            let is_old = (chunk.moves[i] != 0) & ((chunk.times[i] - time).abs() > MOVING_OCCLUDER_AGE_S);
            let occludes = exposure.contains(u, v) & !is_old;
            // A point that does not occlude is infinitely far away, in any cell.
            hits.cells[i] = if occludes { grid.cell(u, v) } else { 0 };
            hits.range_m[i] = if occludes { projected.range_m[i] } else { f32::INFINITY };
        }
    }
}

/// The range of the nearest point of every cell, m.
struct DepthBuffer {
    grid: CellGrid,
    range_m: Vec<f32>,
}

impl DepthBuffer {
    fn new(exposure: &PosedExposure<'_>) -> Self {
        let grid = CellGrid::new(exposure);
        Self { grid, range_m: vec![f32::INFINITY; grid.n_cells()] }
    }

    fn add(&mut self, exposure: &PosedExposure<'_>, chunk: &Chunk, scratch: &mut Scratch, time: f32) {
        let Scratch { projected, hits } = scratch;
        projected.fill(chunk, &exposure.camera_from_submap, exposure.lens);
        Arch::new().dispatch(FindHits { time, exposure: *exposure, grid: self.grid, chunk, projected, hits });
        for (cell, range_m) in hits.cells.iter().zip(&hits.range_m).take(chunk.n_points) {
            let Some(nearest) = self.range_m.get_mut(*cell as usize) else { continue };
            *nearest = if range_m < nearest { *range_m } else { *nearest };
        }
    }

    fn visibility(self, exposure: &PosedExposure<'_>, gap_across: usize) -> VisibilityMap {
        let [columns, rows] = self.grid.size();
        let mut near = self.range_m;
        // Rings are stacked along the vertical of the submap, which may be either axis of the image.
        let [x, y, _] = &exposure.camera_from_submap;
        let (in_rows, in_columns) =
            if y[2].abs() >= x[2].abs() { (GAP_ALONG, gap_across) } else { (gap_across, GAP_ALONG) };
        if near.iter().any(|range_m| range_m.is_finite()) {
            near = close(&near, columns, rows, in_columns, columns);
            near = close(&near, columns, rows, in_rows, 1);
        }
        // One more cell around silhouettes, for pose errors and the space between their points: a missing color is better
        // than a wrong one.
        let max_range_m = max_range_m(&near, columns, rows);
        let max_range_m = spread(&max_range_m, columns, rows, 1, columns, least);
        let max_range_m = spread(&max_range_m, columns, rows, 1, 1, least);
        VisibilityMap::new(self.grid, max_range_m)
    }
}

/// Fills gaps of up to `gap` cells along rows (`stride` 1) or columns (`stride` = `columns`).
fn close(near: &[f32], columns: usize, rows: usize, gap: usize, stride: usize) -> Vec<f32> {
    let radius = gap.div_ceil(2);
    let least = spread(near, columns, rows, radius, stride, least);
    spread(&least, columns, rows, radius, stride, |a, b| if b > a { b } else { a })
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Combines every cell with its neighbors up to `radius` on both sides.
fn spread(
    values: &[f32],
    columns: usize,
    rows: usize,
    radius: usize,
    stride: usize,
    pick: impl Fn(f32, f32) -> f32 + Copy,
) -> Vec<f32> {
    let mut out = values.to_vec();
    if stride > 1 {
        for by in (1..=radius.min(rows - 1)).map(|by| by * columns) {
            let len = values.len() - by;
            Arch::new().dispatch(Combine { out: &mut out[..len], with: &values[by..], pick });
            Arch::new().dispatch(Combine { out: &mut out[by..], with: &values[..len], pick });
        }
    } else {
        for (out, values) in out.chunks_exact_mut(columns).zip(values.chunks_exact(columns)) {
            for by in 1..=radius.min(columns - 1) {
                Arch::new().dispatch(Combine { out: &mut out[..columns - by], with: &values[by..], pick });
                Arch::new().dispatch(Combine { out: &mut out[by..], with: &values[..columns - by], pick });
            }
        }
    }
    out
}

struct Combine<'a, F> {
    out: &'a mut [f32],
    with: &'a [f32],
    pick: F,
}

impl<F: Fn(f32, f32) -> f32> NullaryFnOnce for Combine<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.out.iter_mut().zip(self.with).for_each(|(a, b)| *a = (self.pick)(*a, *b));
    }
}

/// The largest visible range of each cell.
fn max_range_m(near: &[f32], columns: usize, rows: usize) -> Vec<f32> {
    let mut out = vec![0.0; near.len()];
    // A row with its end cells duplicated, so that every cell has two neighbors.
    let mut padded = vec![0.0; columns + 2];
    for (row, out) in out.chunks_exact_mut(columns).enumerate() {
        let line = |row: usize| &near[row * columns..(row + 1) * columns];
        let above = line(row.saturating_sub(1));
        let here = line(row);
        let below = line((row + 1).min(rows - 1));
        padded[1..=columns].copy_from_slice(here);
        (padded[0], padded[columns + 1]) = (here[0], here[columns - 1]);
        Arch::new().dispatch(AddTolerance { above, padded: &padded, below, out });
    }
    out
}

struct AddTolerance<'a> {
    above: &'a [f32],
    padded: &'a [f32],
    below: &'a [f32],
    out: &'a mut [f32],
}

impl NullaryFnOnce for AddTolerance<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { above, padded, below, out } = self;
        let before = padded;
        let here = &padded[1..];
        let after = &padded[2..];
        let around = above.iter().zip(below).zip(before).zip(after);
        for ((out, range_m), (((above, below), before), after)) in out.iter_mut().zip(here).zip(around) {
            let rise = f32::max(rise(*above, *range_m, *below), rise(*before, *range_m, *after));
            let rise = MAX_RISE_SHARE * rise.min(MAX_RISE * range_m.min(f32::MAX));
            *out = range_m + range_m * TOLERANCE_PER_M + TOLERANCE_M + rise;
        }
    }
}

/// Change of range over one cell on a surface that recedes from one neighbor to the other, m: the smaller of the two
/// differences. A silhouette does not recede so: the step to the background does not count as slope.
#[inline(always)]
fn rise(before: f32, here: f32, after: f32) -> f32 {
    let a = here - before;
    let b = after - here;
    // NaN, if two of them are infinite, fails this comparison.
    if a * b > 0.0 { a.abs().min(b.abs()) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_fills_gaps_and_keeps_silhouettes() {
        let far = f32::INFINITY;
        let near = [far, far, 5.0, far, far, 5.0, far, far, far, 9.0, far, far];
        let filled = [far, far, 5.0, 5.0, 5.0, 5.0, far, far, far, 9.0, far, far];
        assert_eq!(close(&near, 12, 1, 2, 1), filled);
        assert_eq!(close(&near, 1, 12, 2, 1), near, "rows of one cell have no gaps");
        assert_eq!(close(&near, 1, 12, 2, 2), filled, "columns");
    }

    #[test]
    fn slope_does_not_occlude_itself_and_step_occludes_far_background() {
        // A street, row by row, then a wall in front of a far one.
        let near = [4.0, 4.4, 5.0, 5.0, 30.0];
        let visible = max_range_m(&near, 1, 5);
        assert!(visible[1] > 5.0 && visible[1] < 5.7, "{visible:?}");
        assert!(visible[3] > 5.1 && visible[3] < 5.3, "the far wall is not part of the near one: {visible:?}");
        assert_eq!(max_range_m(&[f32::INFINITY; 3], 1, 3), [f32::INFINITY; 3]);
    }
}
