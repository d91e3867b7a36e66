//! A sweep as an image of points.

use geometry::{NO_POINT, RangeImage};

/// What one pixel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PolarPixel {
    /// From the sensor's position to the point, in a frame whose z is up, m; zero where there is no point.
    pub ray: [f32; 3],
    /// Above the ground, m.
    pub height_m: f32,
    /// Raw strength of the return.
    pub intensity: u8,
}

impl PolarPixel {
    /// Length of the ray, m; 0 where there is no point.
    pub fn range_m(&self) -> f32 {
        let [x, y, z] = self.ray;
        (x * x + y * y + z * z).sqrt()
    }
    /// Whether it shows a point.
    pub fn is_valid(&self) -> bool {
        self.ray != [0.0; 3]
    }
}

/// An image of points, rows by laser or elevation, columns around the turn.
#[derive(Clone, Debug, PartialEq)]
pub struct PolarImage {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Raster order.
    pub pixels: Vec<PolarPixel>,
    /// Whether intensities are known.
    pub has_intensity: bool,
}

impl PolarImage {
    /// The nearest point of every pixel. `pixel` gives what a point's pixel shall show.
    pub fn of(image: &RangeImage, has_intensity: bool, pixel: impl Fn(usize) -> PolarPixel) -> Self {
        let show = |&point: &u32| if point == NO_POINT { PolarPixel::default() } else { pixel(point as usize) };
        let pixels = image.nearest.iter().map(show).collect();
        Self { rows: image.rows, columns: image.columns, pixels, has_intensity }
    }
    /// The pixel at a row and a column that may lie beyond the seam; `None` above and below and where there is no point.
    pub fn at(&self, row: isize, column: isize) -> Option<&PolarPixel> {
        let row = usize::try_from(row).ok().filter(|&row| row < self.rows)?;
        let column = column.rem_euclid(self.columns as isize) as usize;
        Some(&self.pixels[row * self.columns + column]).filter(|pixel| pixel.is_valid())
    }
    /// Unit normal towards the sensor from the cross product of the steps to the neighbors in row and column; `None` where
    /// there is no surface.
    pub fn normal(&self, row: usize, column: usize) -> Option<[f32; 3]> {
        let here = self.at(row as isize, column as isize)?;
        let range_m = here.range_m();
        let along = self.step(here, range_m, |by| (row as isize, column as isize + by), &COLUMN_STEPS)?;
        let across = self.step(here, range_m, |by| (row as isize + by, column as isize), &ROW_STEPS)?;
        let [a, b] = [along, across];
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let length = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
        if length < 1e-6 {
            return None;
        }
        let towards = cross[0] * here.ray[0] + cross[1] * here.ray[1] + cross[2] * here.ray[2];
        let scale = if towards > 0.0 { -1.0 / length } else { 1.0 / length };
        Some(cross.map(|v| v * scale))
    }
    /// From the neighbor on the one side to that on the other, or from the pixel itself where a side has none on the same
    /// surface.
    fn step(
        &self,
        here: &PolarPixel,
        range_m: f32,
        place: impl Fn(isize) -> (isize, isize),
        steps: &[isize],
    ) -> Option<[f32; 3]> {
        let beside = |sign: isize| {
            steps.iter().find_map(|by| {
                let (row, column) = place(sign * by);
                self.at(row, column).filter(|pixel| (pixel.range_m() - range_m).abs() < SAME_SURFACE * range_m + 0.1)
            })
        };
        let (before, after) = (beside(-1), beside(1));
        if before.is_none() && after.is_none() {
            return None;
        }
        let (before, after) = (before.unwrap_or(here).ray, after.unwrap_or(here).ray);
        Some([after[0] - before[0], after[1] - before[1], after[2] - before[2]])
    }
}

/// Columns to a neighbor: far enough that the range's noise (2 cm) does not turn the normal, near enough to stay on the
/// surface. 4 of 2048 columns are 0.7 deg, half the step between the rings of an HDL-32E.
const COLUMN_STEPS: [isize; 4] = [4, 5, 3, 2];
/// Rows to a neighbor.
const ROW_STEPS: [isize; 1] = [1];
/// Change of the range from one neighbor to the next on one surface, share of the range.
const SAME_SURFACE: f32 = 0.15;

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor 2 m above a floor, beside a wall 5 m to the left.
    fn room() -> PolarImage {
        let (rows, columns) = (32, 1024);
        let pixel = |i: usize| {
            let elevation = (10.0 - 1.33 * (i / columns) as f32).to_radians();
            let azimuth = (i % columns) as f32 / columns as f32 * std::f32::consts::TAU;
            let ray = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
            let to_floor = if ray[2] < 0.0 { -2.0 / ray[2] } else { f32::INFINITY };
            let to_wall = if ray[1] > 0.0 { 5.0 / ray[1] } else { f32::INFINITY };
            let range = to_floor.min(to_wall);
            if range > 60.0 {
                return PolarPixel::default();
            }
            PolarPixel { ray: ray.map(|v| v * range), ..PolarPixel::default() }
        };
        PolarImage { rows, columns, pixels: (0..rows * columns).map(pixel).collect(), has_intensity: false }
    }

    #[test]
    fn normals_stand_on_floor_and_wall() {
        let room = room();
        let (mut n_floor, mut n_wall) = (0, 0);
        for row in 1..31 {
            for column in 0..1024 {
                let Some(pixel) = room.at(row as isize, column as isize) else { continue };
                let Some(normal) = room.normal(row, column) else { continue };
                let away_from_corner = (pixel.ray[2] + 2.0).abs() > 0.6 || (pixel.ray[1] - 5.0).abs() > 0.6;
                if pixel.range_m() > 15.0 || !away_from_corner {
                    continue;
                }
                if (pixel.ray[2] + 2.0).abs() < 1e-3 {
                    assert!(normal[2] > 0.98, "floor at {:?}: {normal:?}", pixel.ray);
                    n_floor += 1;
                } else {
                    assert!(normal[1] < -0.98, "wall at {:?}: {normal:?}", pixel.ray);
                    n_wall += 1;
                }
            }
        }
        assert!(n_floor > 5000 && n_wall > 3000, "{n_floor} {n_wall}");
        assert_eq!(room.normal(0, 768), None, "no point, no normal");
    }
}
