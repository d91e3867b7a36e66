//! The returns of a sweep as a range image, which gives the neighbors of a return.

use crate::TimedPoint;
use lidar::{Directions, fast_atan2, rings_by_order};
use nalgebra::Vector3;

/// Columns: 0.176 degrees each, about the firing step of a Velodyne at 10 Hz (0.166 to 0.18), so few cells get two
/// points.
const COLS: usize = 2048;
/// Number of rows if rings are unknown: one degree of elevation each, about the ring spacing of a 32-beam sensor.
const ELEVATION_ROWS: usize = 90;
/// Index of an empty cell.
const EMPTY: u32 = u32::MAX;
/// Half height of a neighborhood: the ring spacing of the HDL-32E, 1.33 degrees, so that it contains three rings.
const REACH_DEG: f32 = 1.4;

/// Distance of cells from row to row. With a power of two the rows would share a few cache sets, and a sensor fires all
/// rings at once. This is not an `ndarray`: one flat index addresses a cell with its neighbors, and columns wrap
/// around.
pub(crate) const STRIDE: usize = COLS + 4;

/// The point of a cell, 16 bytes. Neighborhoods read its position about fifty times.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Position, m; NaN in an empty cell.
    position: [f32; 3],
    /// Index of the point, or [`EMPTY`].
    point: u32,
}

/// Points by row (ring or elevation) and column (azimuth). Each cell keeps its first point.
#[derive(Clone, Debug)]
pub struct RangeImage {
    rows: usize,
    cells: Vec<Cell>,
    /// Cell index per point; [`EMPTY`] for points that are not finite.
    cell_of: Vec<u32>,
    /// Rows up or down that a neighborhood reaches.
    reach: usize,
    has_rings: bool,
}

impl RangeImage {
    /// Sorts points into cells; see [`crate::Sweep::new`] for `n_rings`.
    pub(crate) fn new(points: &[TimedPoint], n_rings: u32) -> Self {
        let are_numbered = (2..=256).contains(&n_rings)
            && points.iter().all(|point| u32::from(point.ring) < n_rings)
            && points.iter().any(|point| point.ring != points[0].ring);
        let directions = Directions::new(points, |point| point.position);
        let by_order = if are_numbered { None } else { rings_by_order(&directions) };
        let rings_known = are_numbered || by_order.is_some();
        let rows = match &by_order {
            Some(rings) => rings.n,
            None if are_numbered => n_rings as usize,
            None => ELEVATION_ROWS,
        };
        let ring =
            |point_idx: usize| by_order.as_ref().map_or(points[point_idx].ring, |rings| rings.by_point[point_idx]);
        let empty = Cell { position: [f32::NAN; 3], point: EMPTY };
        let mut image = Self {
            rows,
            cells: vec![empty; rows * STRIDE],
            cell_of: Vec::with_capacity(points.len()),
            reach: 2,
            has_rings: rings_known,
        };
        let mut lowest = f32::MAX;
        let mut highest = f32::MIN;
        for ((point, &slope), &azimuth) in points.iter().zip(&directions.slopes).zip(&directions.azimuths) {
            if slope.is_nan() {
                image.cell_of.push(EMPTY);
                continue;
            }
            // `f32::min` is slower because it handles NaN.
            lowest = if slope < lowest { slope } else { lowest };
            highest = if slope > highest { slope } else { highest };
            let row = if rings_known { usize::from(ring(image.cell_of.len())) } else { elevation_row(slope) };
            let idx = row * STRIDE + column_at(azimuth);
            let cell = &mut image.cells[idx];
            if cell.point == EMPTY {
                *cell = Cell { position: point.position, point: image.cell_of.len() as u32 };
            }
            image.cell_of.push(idx as u32);
        }
        if rings_known && highest > lowest {
            let step_deg = (highest.atan() - lowest.atan()).to_degrees() / (rows - 1) as f32;
            image.reach = ((REACH_DEG / step_deg).round() as usize).clamp(1, 4);
        }
        image
    }
    /// A copy of the image with other positions, given by point index, m.
    pub(crate) fn moved(&self, position: impl Fn(usize) -> [f32; 3]) -> Self {
        let mut image = self.clone();
        for cell in image.cells.iter_mut().filter(|cell| cell.point != EMPTY) {
            cell.position = position(cell.point as usize);
        }
        image
    }
    /// The column of a direction.
    #[inline(always)]
    pub(crate) fn column(x: f32, y: f32) -> usize {
        column_at(fast_atan2(y, x))
    }
    /// Number of rows: rings, or elevation bins.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Columns of a full revolution.
    pub fn cols(&self) -> usize {
        COLS
    }
    #[inline(always)]
    fn at(&self, row: usize, col: usize) -> &Cell {
        &self.cells[row * STRIDE + col % COLS]
    }
    /// Index of the point in a cell; columns wrap around.
    #[inline]
    pub fn point(&self, row: usize, col: usize) -> Option<usize> {
        let idx = self.at(row, col).point;
        (idx != EMPTY).then_some(idx as usize)
    }
    /// Position of the point in a cell, m, NaN if it is empty; columns wrap around.
    #[inline(always)]
    pub(crate) fn position(&self, row: usize, col: usize) -> Vector3<f32> {
        Vector3::from(self.at(row, col).position)
    }
    /// Positions of the cells of a row.
    #[inline(always)]
    pub(crate) fn positions_of_row(&self, row: usize) -> impl Iterator<Item = [f32; 3]> {
        self.cells[row * STRIDE..][..COLS].iter().map(|cell| cell.position)
    }
    /// Row and column of a point; `None` if the point is not finite.
    #[inline(always)]
    pub(crate) fn cell(&self, point_idx: usize) -> Option<(usize, usize)> {
        let idx = self.cell_of[point_idx];
        (idx != EMPTY).then_some((idx as usize / STRIDE, idx as usize % STRIDE))
    }
    /// Values of points as an image with [`STRIDE`] cells per row: the value of the first point of each cell, `empty`
    /// in the other cells.
    #[inline(always)]
    pub(crate) fn by_cell<T: Copy>(&self, empty: T, value: impl Fn(usize) -> T) -> Vec<T> {
        let mut values = vec![empty; self.cells.len()];
        // Backwards, so that the first one remains. The loop follows the order of the points, which is the order of
        // their times and of the memory.
        for (point_idx, idx) in self.cell_of.iter().enumerate().rev().filter(|(_, idx)| **idx != EMPTY) {
            values[*idx as usize] = value(point_idx);
        }
        values
    }
    /// Index of the point in a cell that is not empty, from the cell's number.
    pub(crate) fn point_of_cell(&self, number: usize) -> u32 {
        self.cells[number].point
    }
    /// Whether rows are rings, each with its own laser, and not elevation bins.
    pub(crate) fn has_rings(&self) -> bool {
        self.has_rings
    }
    /// Rows up or down that span about [`REACH_DEG`].
    pub(crate) fn reach(&self) -> usize {
        self.reach
    }
}

/// The column of an azimuth, rad.
#[inline(always)]
fn column_at(azimuth: f32) -> usize {
    const PER_RAD: f32 = COLS as f32 / std::f32::consts::TAU;
    /// From here to twice this value, f32 holds whole numbers only: the last bits of a sum are the added number.
    const WHOLE: f32 = (1 << 23) as f32;
    let at = azimuth * PER_RAD + COLS as f32 / 2.0;
    let at = if at > 0.0 { at } else { 0.0 };
    // Rounds down. A loop over conversions to an integer does not vectorize, because they check the limits.
    let nearest = at + WHOLE;
    let down = nearest.to_bits() - u32::from(nearest - WHOLE > at);
    down as usize % COLS
}

fn elevation_row(slope: f32) -> usize {
    let half = ELEVATION_ROWS as f32 / 2.0;
    (slope.atan().to_degrees() + half).clamp(0.0, ELEVATION_ROWS as f32 - 1.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::incidence::incidences;

    /// A wall 10 m ahead, rotated by `angle`, measured by beams 1.33 degrees apart.
    fn wall(angle: f32, rings: bool) -> Vec<TimedPoint> {
        let mut points = Vec::new();
        for column in -100..100 {
            for ring in 0..8_u8 {
                let azimuth = column as f32 * 0.166_f32.to_radians();
                let elevation = (f32::from(ring) - 4.0) * 1.33_f32.to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let normal = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let position = (ray * (10.0 * angle.cos() / ray.dot(&normal))).into();
                points.push(TimedPoint { position, offset_nanos: 0, ring: if rings { ring } else { 0 } });
            }
        }
        points
    }

    #[test]
    fn incidence_is_the_cosine_between_ray_and_normal() {
        for rings in [true, false] {
            for angle in [0.0_f32, 0.5, 1.0] {
                let points = wall(angle, rings);
                let image = RangeImage::new(&points, 8);
                let mut known = 0;
                for (point, cosine) in points.iter().zip(incidences(&image, &points)) {
                    if cosine.is_nan() {
                        continue;
                    }
                    let ray = Vector3::from(point.position).normalize();
                    let expected = ray.dot(&Vector3::new(angle.cos(), angle.sin(), 0.0)).abs();
                    assert!((cosine - expected).abs() < 0.03, "{cosine} {expected}");
                    known += 1;
                }
                assert!(
                    known > points.len() / 2,
                    "rings {rings}, angle {angle}: known for {known} of {}",
                    points.len()
                );
            }
        }
    }

    #[test]
    fn points_that_are_not_finite_have_no_cell() {
        let mut points = wall(0.0, true);
        points[5].position = [f32::NAN, 1.0, 1.0];
        points[6].position = [0.0; 3];
        points[7].position = [f32::INFINITY, 1.0, 1.0];
        let image = RangeImage::new(&points, 8);
        assert!(incidences(&image, &points)[5..8].iter().all(|cosine| cosine.is_nan()));
        assert_eq!(RangeImage::new(&[], 32).point(0, 0), None);
    }
}
