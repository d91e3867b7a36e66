//! Eigenvalues of symmetric 3x3 matrices in closed form (O. K. Smith, CACM 4(4), 1961): no iteration, ~30 ns.

use nalgebra::{Matrix3, Vector3};

/// Eigenvalues from largest to smallest, and the unit eigenvector of the smallest; `None` if that is not determined
/// (two small eigenvalues are equal, or numbers are not finite).
pub(crate) fn smallest_eigenvector(m: &Matrix3<f64>) -> Option<([f64; 3], Vector3<f64>)> {
    let values = eigenvalues(m);
    let shifted = m - Matrix3::identity() * values[2];
    // Rows of the shifted matrix span the plane across the eigenvector; the longest cross product is the safest.
    let [a, b, c] = [shifted.column(0).into_owned(), shifted.column(1).into_owned(), shifted.column(2).into_owned()];
    let candidates = [a.cross(&b), b.cross(&c), c.cross(&a)];
    let longest = candidates.into_iter().max_by(|u, v| u.norm_squared().total_cmp(&v.norm_squared()))?;
    let norm = longest.norm();
    // The cross product is of the order of (l1 - l3)(l2 - l3); the arc cosine loses half the digits of the differences,
    // so below 1e-6 of l1^2 it may be rounding.
    (norm > 1e-6 * values[0] * values[0] && norm.is_finite()).then(|| (values, longest / norm))
}

fn eigenvalues(m: &Matrix3<f64>) -> [f64; 3] {
    let q = m.trace() / 3.0;
    let centered = m - Matrix3::identity() * q;
    let p = (centered.norm_squared() / 6.0).sqrt();
    if p < 1e-30 {
        return [q; 3];
    }
    let half_det = (centered.determinant() / (p * p * p) / 2.0).clamp(-1.0, 1.0);
    let angle = half_det.acos() / 3.0;
    let largest = q + 2.0 * p * angle.cos();
    let smallest = q + 2.0 * p * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    [largest, 3.0 * q - largest - smallest, smallest]
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::UnitQuaternion;

    #[test]
    fn a_turned_diagonal_gives_its_values_and_axis() {
        for (i, axis) in
            [Vector3::new(0.3, -0.2, 0.9), Vector3::new(1.5, 0.1, 0.0), Vector3::zeros()].iter().enumerate()
        {
            let r = UnitQuaternion::from_scaled_axis(*axis).to_rotation_matrix();
            let diagonal = Vector3::new(0.5, 0.02 + i as f64, 0.0004);
            let m = r.matrix() * Matrix3::from_diagonal(&diagonal) * r.matrix().transpose();
            let (values, vector) = smallest_eigenvector(&m).expect("determined");
            let mut expected = [diagonal.x, diagonal.y, diagonal.z];
            expected.sort_by(|a, b| b.total_cmp(a));
            for (value, expected) in values.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-9, "{values:?}");
            }
            assert!((vector.dot(&r.matrix().column(2)).abs() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_line_has_no_normal() {
        assert!(smallest_eigenvector(&Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0))).is_none());
        assert!(smallest_eigenvector(&Matrix3::zeros()).is_none());
        assert!(smallest_eigenvector(&Matrix3::repeat(f64::NAN)).is_none());
    }
}
