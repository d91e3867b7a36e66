//! A lens described by splines: a pinhole image is warped onto the sensor. Calibrations of Ladybug panoramic cameras
//! use this model (Point Grey, "Geometric Vision using Ladybug cameras").

use nalgebra::{Matrix2, Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A pinhole image of the size of the sensor, and the map from its pixels to sensor pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineWarp {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length of the pinhole image along u, px.
    pub fx: f64,
    /// Focal length of the pinhole image along v, px.
    pub fy: f64,
    /// Principal point of the pinhole image, px.
    pub cx: f64,
    /// Principal point of the pinhole image, px.
    pub cy: f64,
    /// u on the sensor as a function of (u, v) in the pinhole image. All values are fractions of the image size, measured
    /// from the left and upper edge.
    pub warp_u: SplineSurface,
    /// v on the sensor, like [`SplineWarp::warp_u`].
    pub warp_v: SplineSurface,
}

/// A cubic B-spline surface over the unit square. Knots are evenly spaced, the outermost have multiplicity four. Coefficients
/// have 4 to 256 rows (first axis) and 4 to 256 columns (second axis).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Vec<f64>>", into = "Vec<Vec<f64>>")]
pub struct SplineSurface(Vec<Vec<f64>>);

/// Coefficients that do not form a spline surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplineSurfaceError {
    /// The coefficients are not a grid of a supported size.
    #[error("{rows} rows, the first with {columns} coefficients; expected 4 to 256 rows of equal length, 4 to 256")]
    Shape {
        /// Rows found.
        rows: usize,
        /// Coefficients of the first row.
        columns: usize,
    },
    /// A coefficient is infinite or NaN.
    #[error("coefficient {column} of row {row} is {value}; expected a finite number")]
    NotFinite {
        /// Row index, counted from 0.
        row: usize,
        /// Column index, counted from 0.
        column: usize,
        /// The coefficient.
        value: f64,
    },
}

impl TryFrom<Vec<Vec<f64>>> for SplineSurface {
    type Error = SplineSurfaceError;

    fn try_from(rows: Vec<Vec<f64>>) -> Result<Self, SplineSurfaceError> {
        let columns = rows.first().map_or(0, Vec::len);
        let is_sized = |n: usize| (4..=256).contains(&n);
        if !is_sized(rows.len()) || !is_sized(columns) || rows.iter().any(|row| row.len() != columns) {
            return Err(SplineSurfaceError::Shape { rows: rows.len(), columns });
        }
        if let Some(idx) = rows.iter().flatten().position(|value| !value.is_finite()) {
            let row = idx / columns;
            let column = idx % columns;
            return Err(SplineSurfaceError::NotFinite { row, column, value: rows[row][column] });
        }
        Ok(Self(rows))
    }
}

impl From<SplineSurface> for Vec<Vec<f64>> {
    fn from(surface: SplineSurface) -> Self {
        surface.0
    }
}

impl SplineSurface {
    /// Value at (x, y) and its partial derivatives. Outside the unit square the outermost patch is extrapolated.
    pub fn at(&self, x: f64, y: f64) -> (f64, [f64; 2]) {
        let (row, across, across_slopes) = basis(x, self.0.len());
        let (column, along, along_slopes) = basis(y, self.0[0].len());
        let mut value = 0.0;
        let mut slopes = [0.0; 2];
        for i in 0..4 {
            for j in 0..4 {
                let c = self.0[row + i][column + j];
                value += c * across[i] * along[j];
                slopes[0] += c * across_slopes[i] * along[j];
                slopes[1] += c * across[i] * along_slopes[j];
            }
        }
        (value, slopes)
    }
}

/// Index of the first of the four coefficients with influence at `x`, their weights and the derivatives of the weights (de Boor,
/// A Practical Guide to Splines, 1978, chapter X).
fn basis(x: f64, n: usize) -> (usize, [f64; 4], [f64; 4]) {
    let n_spans = (n - 3) as f64;
    let at = x * n_spans;
    let span = at.floor().clamp(0.0, n_spans - 1.0);
    // In units of spans, knots are whole numbers. Knots beyond the ends coincide with the ends.
    let knot = |offset: i32| (span + f64::from(offset)).clamp(0.0, n_spans);
    let mut weights = [1.0, 0.0, 0.0, 0.0];
    let mut slopes = [0.0; 4];
    for degree in 1..4_i32 {
        let lower = weights;
        weights = [0.0; 4];
        slopes = [0.0; 4];
        for i in 0..degree {
            let from = knot(i + 1 - degree);
            let to = knot(i + 1);
            let place = i as usize;
            let share = (at - from) / (to - from);
            weights[place] += lower[place] * (1.0 - share);
            weights[place + 1] += lower[place] * share;
            let slope = f64::from(degree) * lower[place] / (to - from) * n_spans;
            slopes[place] -= slope;
            slopes[place + 1] += slope;
        }
    }
    (span as usize, weights, slopes)
}

impl SplineWarp {
    /// Sensor pixel of a point (camera frame, m), inside the image or not. `None` if the point lies outside the pinhole image by
    /// more than the fraction `beyond` of its size.
    pub fn project(&self, p: &Point3<f64>, beyond: f64) -> Option<Vector2<f64>> {
        // A point closer than a nanometre in front of the lens counts as behind it.
        let [u, v] = if p.z > 1e-9 { self.share(p.x / p.z, p.y / p.z) } else { return None };
        let is_known = |share: f64| (-beyond..=1.0 + beyond).contains(&share);
        (is_known(u) && is_known(v)).then(|| self.warped(u, v).0)
    }

    /// Unit direction whose projection is the pixel.
    pub fn unproject(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let size_u = f64::from(self.width);
        let size_v = f64::from(self.height);
        let [u, v] = self.share(0.0, 0.0);
        let (center, slopes) = self.warped(u, v);
        // The initial guess assumes an equidistant lens; Newton's method refines it.
        let shift = slopes.try_inverse()? * (pixel - center);
        let angles = Vector2::new(shift.x * size_u / self.fx, shift.y * size_v / self.fy);
        let angle = angles.norm().min(1.5);
        let stretch = if angle > 1e-9 { angle.tan() / angles.norm() } else { 1.0 };
        let [u, v] = self.share(angles.x * stretch, angles.y * stretch);
        let mut at = Vector2::new(u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
        // 4 rounds reach 1e-9 px on a real lens.
        for _ in 0..12 {
            let (found, slopes) = self.warped(at.x, at.y);
            let step = slopes.try_inverse()? * (pixel - found);
            at += step;
            if step.norm() < 1e-12 {
                break;
            }
        }
        let is_there = (self.warped(at.x, at.y).0 - pixel).norm() < 0.01 && at.iter().all(|v| (0.0..=1.0).contains(v));
        let x = (at.x * size_u - 0.5 - self.cx) / self.fx;
        let y = (at.y * size_v - 0.5 - self.cy) / self.fy;
        is_there.then(|| Vector3::new(x, y, 1.0).normalize())
    }

    /// Pixels per rad on the optical axis, along u and v.
    pub fn px_per_rad(&self) -> [f64; 2] {
        let [u, v] = self.share(0.0, 0.0);
        let slopes = self.warped(u, v).1;
        [slopes[(0, 0)] * self.fx / f64::from(self.width), slopes[(1, 1)] * self.fy / f64::from(self.height)]
    }

    /// Tangents of the angles to the optical axis at the left, right, top and bottom edge of the pinhole image.
    pub fn ends(&self) -> [f64; 4] {
        let end = |px: f64, center: f64, focal: f64| (px - 0.5 - center) / focal;
        let right = f64::from(self.width);
        let bottom = f64::from(self.height);
        [
            end(0.0, self.cx, self.fx),
            end(right, self.cx, self.fx),
            end(0.0, self.cy, self.fy),
            end(bottom, self.cy, self.fy),
        ]
    }

    /// Position in the pinhole image, as fractions of its size.
    fn share(&self, x: f64, y: f64) -> [f64; 2] {
        let size_u = f64::from(self.width);
        let size_v = f64::from(self.height);
        [(self.fx * x + self.cx + 0.5) / size_u, (self.fy * y + self.cy + 0.5) / size_v]
    }

    /// Position on the sensor, px, and its derivatives, px per fraction.
    fn warped(&self, u: f64, v: f64) -> (Vector2<f64>, Matrix2<f64>) {
        let size_u = f64::from(self.width);
        let size_v = f64::from(self.height);
        let (at_u, [uu, uv]) = self.warp_u.at(u, v);
        let (at_v, [vu, vv]) = self.warp_v.at(u, v);
        let slopes = Matrix2::new(size_u * uu, size_u * uv, size_v * vu, size_v * vv);
        (Vector2::new(at_u * size_u - 0.5, at_v * size_v - 0.5), slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_of_greville_abscissae_is_a_plane() {
        // Coefficients that are the means of three knots give back the axis itself.
        let n = 9;
        let greville = |i: usize| (0..3).map(|k| (i + k + 1).clamp(3, n) as f64 - 3.0).sum::<f64>() / 18.0;
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| greville(i) + 3.0 * greville(j)).collect()).collect();
        let surface = SplineSurface::try_from(rows).expect("valid");
        for (x, y) in [(0.0, 0.0), (0.1, 0.77), (0.5, 0.5), (1.0, 1.0), (-0.1, 1.2)] {
            let (value, [along_x, along_y]) = surface.at(x, y);
            assert!((value - x - 3.0 * y).abs() < 1e-12, "{value} at {x}, {y}");
            assert!((along_x - 1.0).abs() < 1e-12 && (along_y - 3.0).abs() < 1e-12, "{along_x} {along_y}");
        }
    }

    #[test]
    fn derivatives_match_finite_differences() {
        let rows: Vec<Vec<f64>> =
            (0..6).map(|i| (0..8).map(|j| f64::from(i * i) * 0.1 - f64::from(i * j) * 0.07).collect()).collect();
        let surface = SplineSurface::try_from(rows).expect("valid");
        for (x, y) in [(0.02, 0.97), (0.3, 0.4), (0.66, 0.61), (0.99, 0.01)] {
            let step = 1e-6;
            let (_, [along_x, along_y]) = surface.at(x, y);
            let slope_x = (surface.at(x + step, y).0 - surface.at(x - step, y).0) / (2.0 * step);
            let slope_y = (surface.at(x, y + step).0 - surface.at(x, y - step).0) / (2.0 * step);
            assert!((along_x - slope_x).abs() < 1e-6 && (along_y - slope_y).abs() < 1e-6, "at {x}, {y}");
        }
    }

    #[test]
    fn invalid_coefficients_are_refused() {
        for rows in [Vec::new(), vec![vec![0.0; 4]; 3], vec![vec![0.0; 4], vec![0.0; 5], vec![], vec![0.0; 4]]] {
            assert!(SplineSurface::try_from(rows).is_err());
        }
        assert!(SplineSurface::try_from(vec![vec![f64::NAN; 4]; 4]).is_err());
    }
}
