//! The spread of the points in a neighborhood.

use super::index::PointIndex;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// The covariance of the points within a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Number of points.
    pub n_points: usize,
    /// Standard deviations along the principal axes, m, smallest first (divided by n).
    pub deviations_m: [f64; 3],
    /// Direction of the smallest deviation; unit length, either sign.
    pub normal: Vector3<f64>,
    /// Natural logarithm of the determinant of the covariance, of m^2.
    pub log_determinant: f64,
}

/// Variance that is added along each axis, m^2: the resolution of an f32 far from the origin, 1 mm. It makes the entropy of points
/// in a plane or on a line finite.
const LEAST_VARIANCE_M2: f64 = 1e-6;

impl Patch {
    /// The patch of all points within `radius_m` of `center`. `None` if there are fewer than 3.
    pub fn around(index: &PointIndex, center: [f32; 3], radius_m: f32) -> Option<Self> {
        // Moments about the center, to avoid cancellation.
        let mut n = 0.0;
        let mut sum = [0.0_f64; 3];
        let mut products = [0.0_f64; 6];
        index.visit_ball(center, radius_m, |point, _| {
            let [x, y, z] = std::array::from_fn(|k| f64::from(point[k] - center[k]));
            n += 1.0;
            sum = [sum[0] + x, sum[1] + y, sum[2] + z];
            for (total, product) in products.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
                *total += product;
            }
        });
        if n < 3.0 {
            return None;
        }
        let mean = Vector3::from(sum) / n;
        let [xx, xy, xz, yy, yz, zz] = products.map(|total| total / n);
        let covariance = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - mean * mean.transpose();
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let variances = order.map(|k| eigen.eigenvalues[k].max(0.0));
        Some(Self {
            n_points: n as usize,
            deviations_m: variances.map(f64::sqrt),
            normal: eigen.eigenvectors.column(order[0]).into_owned(),
            log_determinant: variances.map(|variance| (variance + LEAST_VARIANCE_M2).ln()).iter().sum(),
        })
    }

    /// Differential entropy of the Gaussian with this covariance, nats with lengths in m: `ln sqrt(det(2 pi e C))`.
    pub fn entropy(&self) -> f64 {
        0.5 * (3.0 * (std::f64::consts::TAU.ln() + 1.0) + self.log_determinant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patch_of_tilted_plane_has_its_normal_and_thickness() {
        // Two sheets, 2 cm to either side: the standard deviation is 2 cm.
        let normal = Vector3::new(0.6, 0.0, 0.8);
        let u = Vector3::new(0.8, 0.0, -0.6);
        let v = Vector3::y();
        let place = |i: i32| {
            let a = f64::from(i % 100) * 0.01 - 0.5;
            let b = f64::from(i / 100 % 100) * 0.01 - 0.5;
            let side = if i < 10_000 { 0.02 } else { -0.02 };
            (u * a + v * b + normal * side + Vector3::new(500.0, -200.0, 30.0)).cast::<f32>().into()
        };
        let index = PointIndex::new((0..20_000).map(place).collect(), 0.3);
        let patch = Patch::around(&index, [500.0, -200.0, 30.0], 0.3).expect("has points");
        assert!((patch.deviations_m[0] - 0.02).abs() < 2e-4, "{patch:?}");
        assert!((patch.normal.dot(&normal).abs() - 1.0).abs() < 1e-4);
        // A disk of radius r has a deviation of r / 2 along it.
        assert!((patch.deviations_m[1] - 0.15).abs() < 0.003 && (patch.deviations_m[2] - 0.15).abs() < 0.003);
        let of_deviations: f64 = patch.deviations_m.map(|deviation| (deviation.powi(2) + 1e-6).ln()).iter().sum();
        let expected = 0.5 * (of_deviations + 3.0 * (2.0 * std::f64::consts::PI * std::f64::consts::E).ln());
        assert!((patch.entropy() - expected).abs() < 1e-12);
        assert_eq!(Patch::around(&index, [0.0; 3], 0.3), None);
    }
}
