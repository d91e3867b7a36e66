//! Directions and roughness of what a range image shows, from each pixel's neighbors.

use super::PolarImage;

/// Columns to a neighbor, tried in turn: far enough that the range's noise (2 cm) does not turn the normal, near enough to
/// stay on the surface. 4 of 2048 columns are 0.7 deg, half the step between the rings of an HDL-32E.
const COLUMN_STEPS: [usize; 4] = [4, 5, 3, 2];
/// Change of the range from one neighbor to the next on one surface, share of the range.
const SAME_SURFACE: f32 = 0.15;
/// Columns to the neighbors that roughness is measured against: 0.5 deg of 2048 columns.
const ROUGHNESS_COLUMNS: usize = 3;
/// Columns beyond each end of a row.
const PAD: usize = 5;

/// An image with the ranges of its pixels.
pub(super) struct Surface<'a> {
    image: &'a PolarImage,
    /// By row, with [`PAD`] columns of the other end before and after, m; 0 where there is no point.
    range_m: Vec<f32>,
    pitch: usize,
}

impl<'a> Surface<'a> {
    pub(super) fn of(image: &'a PolarImage) -> Self {
        let pitch = image.columns + 2 * PAD;
        let mut range_m = vec![0.0; image.rows * pitch];
        for (ranges, pixels) in range_m.chunks_exact_mut(pitch).zip(image.pixels.chunks_exact(image.columns)) {
            for (range, pixel) in ranges[PAD..].iter_mut().zip(pixels) {
                *range = pixel.range_m();
            }
            for pad in 0..PAD {
                ranges[pad] = ranges[(pad + image.columns - PAD) % image.columns + PAD];
                ranges[PAD + image.columns + pad] = ranges[PAD + pad % image.columns];
            }
        }
        Self { image, range_m, pitch }
    }
    /// Length of a pixel's ray, m; 0 where there is no point.
    pub(super) fn range_m(&self, row: usize, column: usize) -> f32 {
        self.range_m[row * self.pitch + PAD + column]
    }
    /// The ray of a pixel whose column counts from [`PAD`] before the first.
    fn ray(&self, row: usize, padded: usize) -> [f32; 3] {
        let columns = self.image.columns;
        let column = if padded < PAD { padded + columns - PAD } else { padded - PAD };
        let column = if column < columns { column } else { column % columns };
        self.image.pixels[row * columns + column].ray
    }
    /// Unit normal towards the sensor from the cross product of the steps to the neighbors in row and column; `None` where
    /// there is no surface.
    pub(super) fn normal(&self, row: usize, column: usize) -> Option<[f32; 3]> {
        let range_m = self.range_m(row, column);
        if range_m == 0.0 {
            return None;
        }
        let here = self.ray(row, column + PAD);
        let is_same = |range: f32| range > 0.0 && (range - range_m).abs() < SAME_SURFACE * range_m + 0.1;
        let ranges = &self.range_m[row * self.pitch..][..self.pitch];
        let at = column + PAD;
        let before = COLUMN_STEPS.into_iter().map(|by| at - by).find(|&at| is_same(ranges[at]));
        let after = COLUMN_STEPS.into_iter().map(|by| at + by).find(|&at| is_same(ranges[at]));
        let along = between(before.map(|at| self.ray(row, at)), after.map(|at| self.ray(row, at)), here)?;
        let in_row = |row: usize| is_same(self.range_m(row, column)).then(|| self.ray(row, at));
        let above = row.checked_sub(1).and_then(in_row);
        let below = Some(row + 1).filter(|&row| row < self.image.rows).and_then(in_row);
        let across = between(above, below, here)?;
        let [a, b] = [along, across];
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let length = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
        if length < 1e-6 {
            return None;
        }
        let towards = cross[0] * here[0] + cross[1] * here[1] + cross[2] * here[2];
        let scale = if towards > 0.0 { -1.0 / length } else { 1.0 / length };
        Some(cross.map(|v| v * scale))
    }
    /// Distance of a pixel from the middle of its neighbors in the row, m; `None` at an edge of what is seen.
    pub(super) fn roughness_m(&self, row: usize, column: usize) -> Option<f32> {
        let ranges = &self.range_m[row * self.pitch..][..self.pitch];
        let [before, after] = [column + PAD - ROUGHNESS_COLUMNS, column + PAD + ROUGHNESS_COLUMNS];
        if ranges[before] == 0.0 || ranges[after] == 0.0 {
            return None;
        }
        let (before, here, after) = (self.ray(row, before), self.ray(row, column + PAD), self.ray(row, after));
        let off = |i: usize| here[i] - 0.5 * (before[i] + after[i]);
        Some((off(0) * off(0) + off(1) * off(1) + off(2) * off(2)).sqrt())
    }
}

/// From the neighbor on the one side to that on the other, or from the pixel itself where a side has none.
fn between(before: Option<[f32; 3]>, after: Option<[f32; 3]>, here: [f32; 3]) -> Option<[f32; 3]> {
    if before.is_none() && after.is_none() {
        return None;
    }
    let (before, after) = (before.unwrap_or(here), after.unwrap_or(here));
    Some([after[0] - before[0], after[1] - before[1], after[2] - before[2]])
}
