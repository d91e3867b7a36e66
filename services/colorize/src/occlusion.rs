//! What stands before what: for every exposure, how far it sees in each direction, from the points themselves.
//!
//! A picture is cut into cells of about 0.2 degrees, and each keeps its nearest point (a depth buffer). A LiDAR's points
//! are sparser than that, above all between its rings: so what lies in a gap between two near cells, no wider than the
//! sensor leaves it, is taken for near as well (a closing of the near by a line along and across). Silhouettes stay where they
//! are. A point is hidden if it is farther than its cell allows: the nearest point's range, a tolerance for noise and
//! poses that grows with range, and what the surface rises to in the neighboring cells. That last one is what keeps a road,
//! seen at grazing incidence, from hiding itself.

use crate::choose::{View, gap};
use crate::chunk::{CHUNK, Chunk, Cloud, Extent, Projected, seconds};
use messages::SubmapPoint;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Side of a cell, rad: about the spacing of shots along a ring of a spinning LiDAR at 10 Hz.
const CELL_RAD: f32 = 0.0035;

/// Rings of a spinning LiDAR cover about 40 degrees (HDL-32E: 41), so that they are `RINGS_RAD / n_rings` apart.
const RINGS_RAD: f32 = 0.72;

/// Cells of a gap along the rings that are still filled: three times the spacing of shots, because a camera may be nearer to the
/// surface than the sensor was.
const GAP_ALONG: usize = 3;

/// More would close windows and the space below cars. HDL-32E has 7.
const MAX_GAP_ACROSS: usize = 8;

/// Behind the nearest point by so much is not hidden, m: noise of the range, and of the pose between two shots.
const TOLERANCE_M: f32 = 0.15;

/// The same per metre of range: a quarter of a degree of the pose between exposure and shot, on a slanted surface.
const TOLERANCE_PER_M: f32 = 0.01;

/// Largest rise of a surface over one cell per metre of range: at 40 = tan(88.6 degrees) a street seen from 2 m above is
/// still one surface 80 m ahead.
const MAX_RISE: f32 = CELL_RAD * 40.0;

/// Shots so long before and after an exposure tell what it sees, s: a tilted sensor needs some metres of way to have met
/// everything in the camera's view. For an exposure before or after the submap they are its first or last ones.
const HIDING_AGE_S: f32 = 1.0;

/// The same for points on moving objects. More than a revolution, so that a car is there as a whole; it hides what it has just
/// left, too, which is better than to give it the color of a car.
const MOVING_HIDING_AGE_S: f32 = 0.3;

/// A point may be at the far end of its cell, and the reach is that of the nearest cell beside it: twice the rise over a cell, and
/// more, because a street rises faster with range.
const MAX_RISE_SHARE: f32 = 2.5;

/// How far an exposure sees.
#[derive(Debug)]
pub struct Sight {
    min: [f32; 2],
    cells_per_px: f32,
    columns: usize,
    /// Per cell, row by row: the largest range of what is not hidden, m.
    reach_m: Vec<f32>,
}

impl Sight {
    /// One that nothing stands in the way of.
    pub fn free() -> Self {
        Self { min: [0.0; 2], cells_per_px: 0.0, columns: 1, reach_m: vec![f32::INFINITY] }
    }

    /// Whether a point on this pixel of the view, at this range, is before all else.
    pub fn reaches(&self, u: f32, v: f32, range_m: f32) -> bool {
        let column = ((u - self.min[0]) * self.cells_per_px) as i32 as usize;
        let row = ((v - self.min[1]) * self.cells_per_px) as i32 as usize;
        self.reach_m.get(row * self.columns + column).is_none_or(|reach_m| range_m <= *reach_m)
    }
}

/// Of every view, from the points around its time (`HIDING_AGE_S`), those on moving objects only
/// from shortly before and after (`MOVING_HIDING_AGE_S`).
pub fn sights(cloud: &Cloud<'_>, views: &[View<'_>]) -> Vec<Sight> {
    let nearest: Vec<Nearest> = views.iter().map(Nearest::new).collect();
    let times: Vec<f32> = views.iter().map(|view| seconds(view.stamp, cloud.origin)).collect();
    let end = cloud.sweeps.iter().map(|sweep| seconds(sweep.stamp, cloud.origin)).fold(0.0, f32::max);
    let add_chunk = |scratch: &mut Scratch, (points, extent): (&[SubmapPoint], &Extent)| {
        let mut is_filled = false;
        for ((view, nearest), time) in views.iter().zip(&nearest).zip(&times) {
            let hides = gap(time.clamp(0.0, end), extent.time_span) <= HIDING_AGE_S;
            if hides && view.frustum.meets(&extent.bounds) {
                if !is_filled {
                    scratch.chunk.fill(cloud, points);
                    is_filled = true;
                }
                nearest.add(view, scratch, *time);
            }
        }
    };
    cloud.points.par_chunks(CHUNK).zip(cloud.extents()).for_each_init(Scratch::default, add_chunk);
    let gap_across = (RINGS_RAD / cloud.n_rings.max(1) as f32 / CELL_RAD).ceil().max(1.0) as usize;
    nearest
        .into_par_iter()
        .zip(views)
        .map(|(nearest, view)| nearest.sight(view, gap_across.min(MAX_GAP_ACROSS)))
        .collect()
}

/// Memory that every chunk uses again.
#[derive(Default)]
struct Scratch {
    chunk: Chunk,
    projected: Projected,
    cells: Vec<u32>,
}

/// The depth buffer, while points are added from many threads. Which of them comes first does not show in a minimum.
struct Nearest {
    cells_per_px: f32,
    columns: usize,
    rows: usize,
    /// Range as the bits of an f32, which are ordered as it is.
    range_bits: Vec<AtomicU32>,
}

impl Nearest {
    fn new(view: &View<'_>) -> Self {
        let cells_per_px = 1.0 / (CELL_RAD * view.lens.px_per_rad()).max(1.0);
        let [columns, rows] = [0, 1].map(|axis| ((view.max[axis] - view.min[axis]) * cells_per_px) as usize + 1);
        let far = f32::INFINITY.to_bits();
        let range_bits = (0..columns * rows).map(|_| AtomicU32::new(far)).collect();
        Self { cells_per_px, columns, rows, range_bits }
    }

    fn add(&self, view: &View<'_>, scratch: &mut Scratch, time: f32) {
        let Scratch { chunk, projected, cells } = scratch;
        projected.fill(chunk, &view.camera_from_submap, view.lens);
        let n = chunk.len();
        cells.resize(n, 0);
        let (u, v, cells) = (&projected.u[..n], &projected.v[..n], &mut cells[..n]);
        let (times, moves) = (&chunk.times[..n], &chunk.moves[..n]);
        let (left, top, cells_per_px, columns) = (view.min[0], view.min[1], self.cells_per_px, self.columns as i32);
        // Apart from the loop below, because this one is a vector's work.
        for i in 0..n {
            let column = ((u[i] - left) * cells_per_px) as i32;
            let row = ((v[i] - top) * cells_per_px) as i32;
            let is_old = moves[i] & ((times[i] - time).abs() > MOVING_HIDING_AGE_S);
            let cell = row.wrapping_mul(columns).wrapping_add(column) as u32;
            cells[i] = if view.holds(u[i], v[i]) & !is_old { cell } else { u32::MAX };
        }
        for (cell, range_m) in cells.iter().zip(&projected.range_m) {
            let Some(nearest) = self.range_bits.get(*cell as usize) else { continue };
            let bits = range_m.to_bits();
            // Most points are not the nearest; a look is cheaper than an exchange.
            if bits < nearest.load(Ordering::Relaxed) {
                nearest.fetch_min(bits, Ordering::Relaxed);
            }
        }
    }

    fn sight(self, view: &View<'_>, gap_across: usize) -> Sight {
        let (columns, rows) = (self.columns, self.rows);
        let mut near: Vec<f32> = self.range_bits.into_iter().map(|bits| f32::from_bits(bits.into_inner())).collect();
        // Across the rings is along the submap's vertical, in whichever axis of the image it lies.
        let [x, y, _] = &view.camera_from_submap;
        let (in_rows, in_columns) =
            if y[2].abs() >= x[2].abs() { (GAP_ALONG, gap_across) } else { (gap_across, GAP_ALONG) };
        if near.iter().any(|range_m| range_m.is_finite()) {
            near = close(&near, columns, rows, in_columns, columns);
            near = close(&near, columns, rows, in_rows, 1);
        }
        // A cell to every side for poses and for what lies between the points of a silhouette: rather no color than a wrong one.
        let least = |a: f32, b: f32| if b < a { b } else { a };
        let reach_m = reach_m(&near, columns, rows);
        let reach_m = spread(&reach_m, columns, rows, 1, columns, least);
        let reach_m = spread(&reach_m, columns, rows, 1, 1, least);
        Sight { min: view.min, cells_per_px: self.cells_per_px, columns, reach_m }
    }
}

/// Fills gaps of up to `gap` cells along rows (`stride` 1) or columns (`stride` = `columns`).
fn close(near: &[f32], columns: usize, rows: usize, gap: usize, stride: usize) -> Vec<f32> {
    let radius = gap.div_ceil(2);
    let least = spread(near, columns, rows, radius, stride, |a, b| if b < a { b } else { a });
    spread(&least, columns, rows, radius, stride, |a, b| if b > a { b } else { a })
}

/// Combines every cell with its neighbors up to `radius` to both sides.
fn spread(
    values: &[f32],
    columns: usize,
    rows: usize,
    radius: usize,
    stride: usize,
    pick: impl Fn(f32, f32) -> f32 + Copy,
) -> Vec<f32> {
    let mut out = values.to_vec();
    let combine = |out: &mut [f32], with: &[f32]| out.iter_mut().zip(with).for_each(|(a, b)| *a = pick(*a, *b));
    if stride > 1 {
        for by in (1..=radius.min(rows - 1)).map(|by| by * columns) {
            let len = values.len() - by;
            combine(&mut out[..len], &values[by..]);
            combine(&mut out[by..], &values[..len]);
        }
    } else {
        for (out, values) in out.chunks_exact_mut(columns).zip(values.chunks_exact(columns)) {
            for by in 1..=radius.min(columns - 1) {
                combine(&mut out[..columns - by], &values[by..]);
                combine(&mut out[by..], &values[..columns - by]);
            }
        }
    }
    out
}

/// How far each cell lets see.
fn reach_m(near: &[f32], columns: usize, rows: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(near.len());
    for row in 0..rows {
        let line = |row: usize| &near[row * columns..(row + 1) * columns];
        let (above, here, below) = (line(row.saturating_sub(1)), line(row), line((row + 1).min(rows - 1)));
        for column in 0..columns {
            let range_m = here[column];
            let along = rise(here[column.saturating_sub(1)], range_m, here[(column + 1).min(columns - 1)]);
            let rise = rise(above[column], range_m, below[column]).max(along);
            let rise = MAX_RISE_SHARE * rise.min(MAX_RISE * range_m.min(f32::MAX));
            out.push(range_m + range_m * TOLERANCE_PER_M + TOLERANCE_M + rise);
        }
    }
    out
}

/// By how much a surface that falls from one neighbor and rises to the other does so over a cell, m: the lesser of the two. At a
/// silhouette one of them is nothing, and what lies far behind it does not count as its slope.
fn rise(before: f32, here: f32, after: f32) -> f32 {
    let (a, b) = (here - before, after - here);
    if a * b > 0.0 { a.abs().min(b.abs()) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_filled_and_silhouettes_stay() {
        let far = f32::INFINITY;
        let near = [far, far, 5.0, far, far, 5.0, far, far, far, 9.0, far, far];
        let filled = [far, far, 5.0, 5.0, 5.0, 5.0, far, far, far, 9.0, far, far];
        assert_eq!(close(&near, 12, 1, 2, 1), filled);
        assert_eq!(close(&near, 1, 12, 2, 1), near, "rows of one cell have no gaps");
        assert_eq!(close(&near, 1, 12, 2, 2), filled, "columns");
    }

    #[test]
    fn a_slope_does_not_hide_itself_and_a_step_hides_what_is_far_behind() {
        // A street from row to row, then a wall before a far one.
        let near = [4.0, 4.4, 5.0, 5.0, 30.0];
        let reach = reach_m(&near, 1, 5);
        assert!(reach[1] > 5.0 && reach[1] < 5.7, "{reach:?}");
        assert!(reach[3] > 5.1 && reach[3] < 5.3, "the far wall is no part of the near one: {reach:?}");
        assert_eq!(reach_m(&[f32::INFINITY; 3], 1, 3), [f32::INFINITY; 3]);
    }
}
