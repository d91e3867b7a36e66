//! Sums of products of the measurements of the unit and the motion of the LiDAR, and the axes and units that fit them
//! best.

use super::axes::Axes;
use geometry::Vector3;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// Weight of a pair after one more pair: units can fail during a drive. The sums cover the last minute of a drive at 10
/// Hz.
const MEMORY: f64 = 1.0 - 1.0 / 600.0;

/// Sums over pairs of vectors.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Sums {
    n: f64,
    body: Vector3<f64>,
    unit: Vector3<f64>,
    body_by_unit: Matrix3<f64>,
    body_square: Vector3<f64>,
    unit_square: f64,
}

/// Conversion of the vectors of a unit to body vectors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Axes.
    pub axes: Axes,
    /// Scale factor of the unit's values.
    pub scale: f64,
}

/// The best fit to the sums.
#[derive(Clone, Copy, Debug)]
pub struct BestFit {
    /// The fit.
    pub fit: Fit,
    /// Residual of the best fit with other axes.
    pub other_residual: f64,
}

impl Fit {
    /// Body axes and the documented unit of measurement.
    pub const NOMINAL: Self = Self { axes: Axes::BODY, scale: 1.0 };
}

impl Sums {
    /// Adds a pair.
    pub fn add(&mut self, body: &Vector3<f64>, unit: &Vector3<f64>) {
        self.n = self.n * MEMORY + 1.0;
        self.body = self.body * MEMORY + body;
        self.unit = self.unit * MEMORY + unit;
        self.body_by_unit = self.body_by_unit * MEMORY + body * unit.transpose();
        self.body_square = self.body_square * MEMORY + body.component_mul(body);
        self.unit_square = self.unit_square * MEMORY + unit.norm_squared();
    }

    /// Weight of all pairs.
    pub const fn n(&self) -> f64 {
        self.n
    }

    /// The centered sums, without biases.
    #[must_use]
    pub fn centered(&self) -> Self {
        let n = self.n.max(1.0);
        Self {
            n: self.n,
            body: Vector3::zeros(),
            unit: Vector3::zeros(),
            body_by_unit: self.body_by_unit - self.body * self.unit.transpose() / n,
            body_square: self.body_square - self.body.component_mul(&self.body) / n,
            unit_square: (self.unit_square - self.unit.norm_squared() / n).max(0.0),
        }
    }

    /// Sum of the squares of the body vectors.
    pub fn signal(&self) -> f64 {
        self.body_square.sum().max(0.0)
    }

    /// Sum of the squares of the body vectors per axis.
    pub const fn signals(&self) -> Vector3<f64> {
        self.body_square
    }

    /// Sum of the squared differences under a fit.
    pub fn residual(&self, fit: &Fit) -> f64 {
        let Fit { axes, scale } = fit;
        let sum = self.signal() - 2.0 * scale * axes.product(&self.body_by_unit) + scale * scale * self.unit_square;
        sum.max(0.0)
    }

    /// The best fit with one of these scales.
    pub fn best(&self, scales: &[f64]) -> BestFit {
        let fits = || Axes::all().flat_map(|axes| scales.iter().map(move |scale| Fit { axes, scale: *scale }));
        let least = |fits: &mut dyn Iterator<Item = Fit>| {
            fits.map(|fit| (fit, self.residual(&fit))).min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (fit, _) = least(&mut fits()).unwrap_or((Fit::NOMINAL, 0.0));
        let others = least(&mut fits().filter(|other| other.axes != fit.axes));
        BestFit { fit, other_residual: others.map_or(f64::MAX, |(_, residual)| residual) }
    }

    /// Sum of the outer products of body and unit vectors under a fit.
    pub fn products(&self, fit: &Fit) -> Matrix3<f64> {
        self.body_by_unit * fit.axes.matrix().transpose() * fit.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_unit_of_measured_vectors_are_found() {
        let degrees = 1.0_f64.to_radians();
        for axes in Axes::all().step_by(5) {
            let mut sums = Sums::default();
            for i in 0..200 {
                let t = f64::from(i) * 0.1;
                let body = Vector3::new(0.02 * (3.0 * t).sin(), 0.03 * (4.0 * t).cos(), 0.3 * (0.5 * t).sin());
                let biased = (body + Vector3::new(0.01, -0.02, 0.03)) / degrees;
                sums.add(&body, &(axes.matrix().transpose() * biased));
            }
            let centered = sums.centered();
            let BestFit { fit: best, other_residual: second } = centered.best(&[1.0, degrees]);
            assert_eq!(best, Fit { axes, scale: degrees });
            assert!(centered.residual(&best) < 1e-9 && second > 1e-3, "{second}");
        }
    }
}
