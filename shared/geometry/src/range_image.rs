//! Range images of a rotating lidar: rows by elevation, columns by azimuth (thesis section 2.4.3).

use std::f32::consts::{PI, TAU};

/// Index of a pixel without a point, and pixel of a point outside the image.
pub const NO_POINT: u32 = u32::MAX;

/// Spherical projection of points to pixels: eq. (2.2) to (2.8), with (2.7) as
/// row = H (1 - (theta + |down|) / (|up| + |down|)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphericalGrid {
    /// Rows; row 0 is the highest.
    pub rows: usize,
    /// Columns of a full revolution. The middle column looks along x; columns left of it show the right side of the sensor (-y).
    pub columns: usize,
    /// Elevation of the upper edge, rad.
    pub up: f32,
    /// Elevation of the lower edge, rad; below `up`.
    pub down: f32,
}

impl SphericalGrid {
    /// Row and column of a point in the sensor frame; `None` outside the elevation range, at the origin and for NaN.
    pub fn pixel(&self, [x, y, z]: [f32; 3]) -> Option<(usize, usize)> {
        let range = (x * x + y * y + z * z).sqrt();
        let theta = (z / range).asin();
        let row = self.rows as f32 * (1.0 - (theta - self.down) / (self.up - self.down));
        let column = self.columns as f32 * 0.5 * (y.atan2(x) / PI + 1.0);
        if !(row >= 0.0 && row < self.rows as f32 && column.is_finite()) {
            return None;
        }
        // atan2 may return exactly pi, which is the far edge of the last column and the near edge of the first.
        Some((row as usize, column as usize % self.columns))
    }
}

/// Column of an encoder angle (0.01 deg, 0 to 35999) in an image of `columns` columns.
pub fn column_of_azimuth(azimuth: u16, columns: usize) -> usize {
    (usize::from(azimuth) * columns / 36_000).min(columns - 1)
}

/// Nearest point of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeImage {
    /// Rows.
    pub rows: usize,
    /// Columns. The last column is a neighbor of the first.
    pub columns: usize,
    /// Index of the nearest point of each pixel in raster order, [`NO_POINT`] for empty pixels.
    pub nearest: Vec<u32>,
    /// Pixel index of each point, [`NO_POINT`] for points outside the image.
    pub pixel_of_point: Vec<u32>,
    /// Range of each point, m.
    pub range_m: Vec<f32>,
}

impl RangeImage {
    /// Builds the image from row and column (`None` outside) and range in m of each point. The first of several points
    /// with equal range is kept.
    pub fn new(rows: usize, columns: usize, points: impl IntoIterator<Item = (Option<(usize, usize)>, f32)>) -> Self {
        let points = points.into_iter();
        let n_points = points.size_hint().0;
        let mut image = Self {
            rows,
            columns,
            nearest: vec![NO_POINT; rows * columns],
            pixel_of_point: Vec::with_capacity(n_points),
            range_m: Vec::with_capacity(n_points),
        };
        for (index, (pixel, range_m)) in points.enumerate() {
            let pixel = pixel.filter(|&(row, column)| row < rows && column < columns && range_m.is_finite());
            image.range_m.push(range_m);
            let Some((row, column)) = pixel else {
                image.pixel_of_point.push(NO_POINT);
                continue;
            };
            let at = row * columns + column;
            image.pixel_of_point.push(at as u32);
            let shown = image.nearest[at];
            if shown == NO_POINT || range_m < image.range_m[shown as usize] {
                image.nearest[at] = index as u32;
            }
        }
        image
    }
    /// Fraction of the points in the image that share a pixel with an earlier point (figure 6.5), 0 to 1.
    pub fn collision_rate(&self) -> f64 {
        let n_inside = self.pixel_of_point.iter().filter(|&&pixel| pixel != NO_POINT).count();
        let n_pixels = self.nearest.iter().filter(|&&point| point != NO_POINT).count();
        (n_inside - n_pixels) as f64 / n_inside.max(1) as f64
    }
    /// Whether a point is the nearest of its pixel.
    pub fn is_shown(&self, point: usize) -> bool {
        let pixel = self.pixel_of_point[point];
        pixel != NO_POINT && self.nearest[pixel as usize] as usize == point
    }
    /// Points of the pixels within `reach` rows and columns of the pixel of a point, with their offsets in pixels (row, column).
    /// Columns wrap around. Empty for a point outside the image.
    pub fn window(&self, point: usize, reach: usize) -> impl Iterator<Item = (usize, [isize; 2])> {
        let pixel = self.pixel_of_point[point] as usize;
        let row = pixel / self.columns;
        let column = pixel % self.columns;
        let reach = if self.pixel_of_point[point] == NO_POINT { -1 } else { reach as isize };
        let offsets = (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| [dy, dx]));
        offsets.filter_map(move |[dy, dx]| {
            let row = row.checked_add_signed(dy).filter(|&row| row < self.rows)?;
            let column = (column as isize + dx).rem_euclid(self.columns as isize) as usize;
            let shown = self.nearest[row * self.columns + column];
            (shown != NO_POINT).then_some((shown as usize, [dy, dx]))
        })
    }
}

/// Angle between neighboring columns, rad.
pub fn column_angle(columns: usize) -> f32 {
    TAU / columns as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: SphericalGrid = SphericalGrid { rows: 64, columns: 1024, up: 0.05, down: -0.43 };

    #[test]
    fn pixels_follow_the_projection_formula() {
        assert_eq!(GRID.pixel([10.0, 0.0, 0.0]), Some((6, 512)));
        // Left is past the middle column, right is before it, and the seam is behind the sensor.
        assert_eq!(GRID.pixel([0.0, 5.0, 0.0]).map(|p| p.1), Some(768));
        assert_eq!(GRID.pixel([0.0, -5.0, 0.0]).map(|p| p.1), Some(256));
        assert_eq!(GRID.pixel([-5.0, 0.0, 0.0]).map(|p| p.1), Some(0));
        assert_eq!(GRID.pixel([-5.0, -1e-6, 0.0]).map(|p| p.1), Some(0));
        for outside in [[1.0, 0.0, 0.2], [1.0, 0.0, -0.9], [0.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0]] {
            assert_eq!(GRID.pixel(outside), None, "{outside:?}");
        }
        // The center of every pixel maps to that pixel.
        for row in 0..64 {
            for column in (0..1024).step_by(7) {
                let theta = GRID.down + (1.0 - (row as f32 + 0.5) / 64.0) * (GRID.up - GRID.down);
                let phi = ((column as f32 + 0.5) / 512.0 - 1.0) * PI;
                let point = [theta.cos() * phi.cos(), theta.cos() * phi.sin(), theta.sin()];
                assert_eq!(GRID.pixel(point), Some((row, column)));
            }
        }
    }

    #[test]
    fn pixel_keeps_its_nearest_point() {
        let points = [(Some((0, 3)), 5.0), (Some((0, 3)), 2.0), (Some((0, 3)), 2.0), (None, 1.0), (Some((1, 0)), 9.0)];
        let image = RangeImage::new(2, 4, points);
        assert_eq!(image.nearest, [NO_POINT, NO_POINT, NO_POINT, 1, 4, NO_POINT, NO_POINT, NO_POINT]);
        assert_eq!((0..5).map(|i| image.is_shown(i)).collect::<Vec<_>>(), [false, true, false, false, true]);
        assert_eq!(image.collision_rate(), 0.5);
        // Columns wrap around: column 3 and column 0 are neighbors.
        let found: Vec<_> = image.window(0, 1).collect();
        assert_eq!(found, [(1, [0, 0]), (4, [1, 1])]);
        assert_eq!(image.window(3, 1).count(), 0);
    }

    #[test]
    fn encoder_angles_fill_all_columns() {
        assert_eq!((column_of_azimuth(0, 2048), column_of_azimuth(35_999, 2048)), (0, 2047));
        let columns: std::collections::BTreeSet<usize> = (0..36_000).map(|a| column_of_azimuth(a, 2048)).collect();
        assert_eq!(columns.len(), 2048);
    }
}
