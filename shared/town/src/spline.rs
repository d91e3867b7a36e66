//! Smooth curves near evenly spaced points: uniform B-splines of degree five (de Boor, "A practical guide to splines", 1978).
//!
//! The first four derivatives are continuous, so that an IMU on such a curve measures no steps. Curves pass near their
//! points, not through them: corners are rounded, which makes turns of streets and starts of vehicles as smooth as real
//! ones. Evenly spaced points on a line are followed exactly.

use nalgebra::SVector;

/// A curve in `D` dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline<const D: usize> {
    points: Vec<SVector<f64, D>>,
    is_closed: bool,
}

impl<const D: usize> Spline<D> {
    /// A curve with ends: it is constant before the first point and after the last one. `None` without points.
    pub fn open(points: Vec<SVector<f64, D>>) -> Option<Self> {
        (!points.is_empty()).then_some(Self { points, is_closed: false })
    }
    /// A curve that returns to its start. `None` without points.
    pub fn closed(points: Vec<SVector<f64, D>>) -> Option<Self> {
        (!points.is_empty()).then_some(Self { points, is_closed: true })
    }
    /// Number of points.
    pub const fn len(&self) -> usize {
        self.points.len()
    }
    /// Position at `u`, counted in points.
    pub fn at(&self, u: f64) -> SVector<f64, D> {
        let t = u - u.floor();
        let t2 = t * t;
        let t3 = t.powi(3);
        let t4 = t.powi(4);
        let t5 = t.powi(5);
        self.sum(
            u,
            [
                (1.0 - t).powi(5),
                26.0 - 50.0 * t + 20.0 * t2 + 20.0 * t3 - 20.0 * t4 + 5.0 * t5,
                66.0 - 60.0 * t2 + 30.0 * t4 - 10.0 * t5,
                26.0 + 50.0 * t + 20.0 * t2 - 20.0 * t3 - 20.0 * t4 + 10.0 * t5,
                1.0 + 5.0 * t + 10.0 * t2 + 10.0 * t3 + 5.0 * t4 - 5.0 * t5,
                t5,
            ],
        )
    }
    /// Derivative with respect to `u`.
    pub fn slope(&self, u: f64) -> SVector<f64, D> {
        let t = u - u.floor();
        let t2 = t * t;
        let t3 = t.powi(3);
        let t4 = t.powi(4);
        self.sum(
            u,
            [
                -5.0 * (1.0 - t).powi(4),
                -50.0 + 40.0 * t + 60.0 * t2 - 80.0 * t3 + 25.0 * t4,
                -120.0 * t + 120.0 * t3 - 50.0 * t4,
                50.0 + 40.0 * t - 60.0 * t2 - 80.0 * t3 + 50.0 * t4,
                5.0 + 20.0 * t + 30.0 * t2 + 20.0 * t3 - 25.0 * t4,
                5.0 * t4,
            ],
        )
    }
    fn sum(&self, u: f64, weights: [f64; 6]) -> SVector<f64, D> {
        let first = u.floor() as i64 - 2;
        let n = self.points.len() as i64;
        let point = |i: i64| {
            let i = if self.is_closed { i.rem_euclid(n) } else { i.clamp(0, n - 1) };
            self.points[i as usize]
        };
        let sum = (first..).zip(weights).fold(SVector::zeros(), |sum, (i, weight)| sum + point(i) * weight);
        sum / 120.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn spline_reproduces_straight_line() {
        let line = Spline::open((0..20).map(|i| Vector2::new(f64::from(i), 3.0 - 2.0 * f64::from(i))).collect());
        let line = line.expect("points");
        for i in 0..40 {
            let u = 4.0 + 0.27 * f64::from(i);
            assert!((line.at(u) - Vector2::new(u, 3.0 - 2.0 * u)).norm() < 1e-12);
            assert!((line.slope(u) - Vector2::new(1.0, -2.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn spline_rounds_corners_and_slope_is_its_derivative() {
        let corner =
            |i: i32| if i < 10 { Vector2::new(f64::from(i), 0.0) } else { Vector2::new(10.0, f64::from(i - 10)) };
        let curve = Spline::open((0..20).map(corner).collect()).expect("points");
        let bend = |u: f64| (curve.slope(u + 1e-5) - curve.slope(u - 1e-5)) / 2e-5;
        for i in 0..600 {
            let u = 5.0 + 0.015 * f64::from(i);
            let numeric = (curve.at(u + 1e-5) - curve.at(u - 1e-5)) / 2e-5;
            assert!((curve.slope(u) - numeric).norm() < 1e-8);
            assert!((bend(u + 1e-3) - bend(u)).norm() < 2e-3);
        }
        assert!(curve.at(10.0).x < 9.9 && curve.at(10.0).x > 9.0);
    }

    #[test]
    fn closed_spline_has_no_seam() {
        let ring = (0..12)
            .map(|i| f64::from(i) * std::f64::consts::FRAC_PI_6)
            .map(|a| Vector2::new(a.cos(), a.sin()))
            .collect();
        let ring = Spline::closed(ring).expect("points");
        assert!((ring.at(11.999_999) - ring.at(0.0)).norm() < 1e-5);
        assert_eq!(ring.at(3.5), ring.at(15.5));
    }
}
