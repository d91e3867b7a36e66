//! What stands before what: for every exposure, how far it sees in each direction, from the points themselves.
//!
//! A picture is cut into cells of about 0.2 degrees, and each keeps its nearest point (a depth buffer). A LiDAR's points
//! are sparser than that, above all between its rings: so what lies in a gap between two near cells, no wider than the
//! sensor leaves it, is taken for near as well (a closing of the near by a line along and across). Silhouettes stay where they
//! are. A point is hidden if it is farther than its cell allows: the nearest point's range, a tolerance for noise and
//! poses that grows with range, and what the surface rises to in the neighboring cells. That last one is what keeps a road,
//! seen at grazing incidence, from hiding itself.

use crate::choose::{View, gap};
use crate::chunk::{CHUNK, Chunk, Lanes, Projected, seconds};
use crate::cloud::Cloud;
use pulp::{Arch, NullaryFnOnce};
use rayon::prelude::*;

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

/// The cells of a view.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    min: [f32; 2],
    cells_per_px: f32,
    columns: i32,
    rows: i32,
}

/// An index that no grid has.
pub const NO_CELL: u32 = u32::MAX;

impl Grid {
    fn new(view: &View<'_>) -> Self {
        let cells_per_px = 1.0 / (CELL_RAD * view.lens.px_per_rad()).max(1.0);
        let [columns, rows] = [0, 1].map(|axis| ((view.max[axis] - view.min[axis]) * cells_per_px) as i32 + 1);
        Self { min: view.min, cells_per_px, columns, rows }
    }

    /// The cell of a pixel that the view holds; of others, none or any.
    #[inline(always)]
    pub fn cell(&self, u: f32, v: f32) -> u32 {
        // Pixels that are not held may be any number, which the conversion would take long to bend to the nearest integer.
        let column = ((u - self.min[0]) * self.cells_per_px) as i32;
        let row = ((v - self.min[1]) * self.cells_per_px) as i32;
        row.wrapping_mul(self.columns).wrapping_add(column) as u32
    }
}

/// How far an exposure sees.
#[derive(Debug)]
pub struct Sight {
    /// Its cells.
    pub grid: Grid,
    /// Per cell, row by row: the largest range of what is not hidden, m.
    reach_m: Vec<f32>,
}

impl Sight {
    /// One that nothing stands in the way of.
    pub fn free() -> Self {
        let grid = Grid { min: [0.0; 2], cells_per_px: 0.0, columns: 1, rows: 1 };
        Self { grid, reach_m: vec![f32::INFINITY] }
    }

    /// The largest range of what is not hidden, m; none at all where there is no such cell.
    #[inline(always)]
    pub fn reach_m(&self, cell: u32) -> f32 {
        self.reach_m.get(cell as usize).copied().unwrap_or(f32::NEG_INFINITY)
    }
}

/// Of every view, from the points around its time (`HIDING_AGE_S`), those on moving objects only
/// from shortly before and after (`MOVING_HIDING_AGE_S`).
pub fn sights(cloud: &Cloud<'_>, views: &[View<'_>]) -> Vec<Sight> {
    let [begin, end] = cloud.time_span();
    let gap_across = (RINGS_RAD / cloud.n_rings.max(1) as f32 / CELL_RAD).ceil().max(1.0) as usize;
    let of_task = |scratch: &mut Scratch, views: &[View<'_>]| -> Vec<Sight> {
        let mut nearest: Vec<Nearest> = views.iter().map(Nearest::new).collect();
        for chunk in cloud.occluders() {
            for (view, nearest) in views.iter().zip(&mut nearest) {
                let time = seconds(view.stamp, cloud.origin);
                let hides = gap(time.max(begin).min(end), chunk.time_span) <= HIDING_AGE_S;
                if hides && view.frustum.meets(&chunk.bounds) {
                    nearest.add(view, chunk, scratch, time);
                }
            }
        }
        let pairs = nearest.into_iter().zip(views);
        pairs.map(|(nearest, view)| nearest.sight(view, gap_across.min(MAX_GAP_ACROSS))).collect()
    };
    views.par_chunks(VIEWS_PER_TASK).map_init(Scratch::default, of_task).flatten_iter().collect()
}

/// Views that look through the points together: those of one time meet a chunk while it is in the cache. More would leave threads
/// without work.
const VIEWS_PER_TASK: usize = 3;

/// Memory that every chunk uses again.
#[derive(Default)]
struct Scratch {
    projected: Projected,
    hits: Hits,
}

/// What the points of a chunk hide.
struct Hits {
    cells: Lanes<u32>,
    /// Infinite for a point that hides nothing.
    range_m: Lanes<f32>,
}

impl Default for Hits {
    fn default() -> Self {
        Self { cells: [0; CHUNK], range_m: [0.0; CHUNK] }
    }
}

/// Finds the cells of the points that hide something.
struct Hide<'a> {
    /// Of the view, s after the submap's first shot.
    time: f32,
    view: View<'a>,
    grid: Grid,
    chunk: &'a Chunk,
    projected: &'a Projected,
    hits: &'a mut Hits,
}

impl NullaryFnOnce for Hide<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { time, view, grid, chunk, projected, hits } = self;
        for i in 0..chunk.n_lanes() {
            let (u, v) = (projected.u[i], projected.v[i]);
            let is_old = (chunk.moves[i] != 0) & ((chunk.times[i] - time).abs() > MOVING_HIDING_AGE_S);
            let hides = view.holds(u, v) & !is_old;
            // What does not hide is infinitely far, in whichever cell.
            hits.cells[i] = if hides { grid.cell(u, v) } else { 0 };
            hits.range_m[i] = if hides { projected.range_m[i] } else { f32::INFINITY };
        }
    }
}

/// The depth buffer: the range of the nearest point of every cell, m.
struct Nearest {
    grid: Grid,
    range_m: Vec<f32>,
}

impl Nearest {
    fn new(view: &View<'_>) -> Self {
        let grid = Grid::new(view);
        Self { grid, range_m: vec![f32::INFINITY; (grid.columns * grid.rows) as usize] }
    }

    fn add(&mut self, view: &View<'_>, chunk: &Chunk, scratch: &mut Scratch, time: f32) {
        let Scratch { projected, hits } = scratch;
        projected.fill(chunk, &view.camera_from_submap, view.lens);
        Arch::new().dispatch(Hide { time, view: *view, grid: self.grid, chunk, projected, hits });
        for (cell, range_m) in hits.cells.iter().zip(&hits.range_m).take(chunk.n_points) {
            let Some(nearest) = self.range_m.get_mut(*cell as usize) else { continue };
            *nearest = if range_m < nearest { *range_m } else { *nearest };
        }
    }

    fn sight(self, view: &View<'_>, gap_across: usize) -> Sight {
        let [columns, rows] = [self.grid.columns, self.grid.rows].map(|n| n as usize);
        let mut near = self.range_m;
        // Across the rings is along the submap's vertical, in whichever axis of the image it lies.
        let [x, y, _] = &view.camera_from_submap;
        let (in_rows, in_columns) =
            if y[2].abs() >= x[2].abs() { (GAP_ALONG, gap_across) } else { (gap_across, GAP_ALONG) };
        if near.iter().any(|range_m| range_m.is_finite()) {
            near = close(&near, columns, rows, in_columns, columns);
            near = close(&near, columns, rows, in_rows, 1);
        }
        // A cell to every side for poses and for what lies between the points of a silhouette: rather no color than a wrong one.
        let reach_m = reach_m(&near, columns, rows);
        let reach_m = spread(&reach_m, columns, rows, 1, columns, least);
        let reach_m = spread(&reach_m, columns, rows, 1, 1, least);
        Sight { grid: self.grid, reach_m }
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

/// How far each cell lets see.
fn reach_m(near: &[f32], columns: usize, rows: usize) -> Vec<f32> {
    let mut out = vec![0.0; near.len()];
    // A row with its ends twice, so that every cell has neighbors. What falls to nowhere on one side is no slope.
    let mut padded = vec![0.0; columns + 2];
    for (row, out) in out.chunks_exact_mut(columns).enumerate() {
        let line = |row: usize| &near[row * columns..(row + 1) * columns];
        let (above, here, below) = (line(row.saturating_sub(1)), line(row), line((row + 1).min(rows - 1)));
        padded[1..=columns].copy_from_slice(here);
        (padded[0], padded[columns + 1]) = (here[0], here[columns - 1]);
        Arch::new().dispatch(Reach { above, padded: &padded, below, out });
    }
    out
}

struct Reach<'a> {
    above: &'a [f32],
    padded: &'a [f32],
    below: &'a [f32],
    out: &'a mut [f32],
}

impl NullaryFnOnce for Reach<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { above, padded, below, out } = self;
        let (before, here, after) = (padded, &padded[1..], &padded[2..]);
        let around = above.iter().zip(below).zip(before).zip(after);
        for ((out, range_m), (((above, below), before), after)) in out.iter_mut().zip(here).zip(around) {
            let rise = f32::max(rise(*above, *range_m, *below), rise(*before, *range_m, *after));
            let rise = MAX_RISE_SHARE * rise.min(MAX_RISE * range_m.min(f32::MAX));
            *out = range_m + range_m * TOLERANCE_PER_M + TOLERANCE_M + rise;
        }
    }
}

/// By how much a surface that falls from one neighbor and rises to the other does so over a cell, m: the lesser of the two. At a
/// silhouette one of them is nothing, and what lies far behind it does not count as its slope.
#[inline(always)]
fn rise(before: f32, here: f32, after: f32) -> f32 {
    let (a, b) = (here - before, after - here);
    // NaN, where two of them are infinite, is not above anything.
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
