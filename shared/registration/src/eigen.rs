//! Eigenvalues of symmetric 3x3 matrices in closed form (O. K. Smith, CACM 4(4), 1961).

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
    // The values are q + 2 p c with 4 c^3 - 3 c = half_det. The smallest is the best determined of a plane.
    let smallest = -cosine_of_third(-half_det);
    let root = (smallest * smallest - half_det / smallest).max(0.0).sqrt();
    let largest = 0.5 * (root - smallest);
    let [largest, smallest] = [largest, smallest].map(|c| q + 2.0 * p * c);
    [largest, 3.0 * q - largest - smallest, smallest]
}

/// cos(acos(x) / 3), the largest root of 4 c^3 - 3 c = x for x in -1 to 1, by Newton's method: a third of the time of the
/// arc cosine and the cosine. Near -1, a double root, within the square root of the rounding error.
fn cosine_of_third(x: f64) -> f64 {
    // With u = cos(acos(x) / 2) the root is nearly a parabola.
    let u = (0.5 + 0.5 * x).max(0.0).sqrt();
    let mut c = 0.5 + u * (0.564 - 0.064 * u);
    for _ in 0..3 {
        let slope = 12.0 * c * c - 3.0;
        if slope < 1e-9 {
            return 0.5;
        }
        c -= (c * (4.0 * c * c - 3.0) - x) / slope;
    }
    c
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
    fn the_root_is_that_of_the_cosine() {
        for i in 0..=2000 {
            let x = f64::from(i) / 1000.0 - 1.0;
            let error = (cosine_of_third(x) - (x.acos() / 3.0).cos()).abs();
            assert!(error < 1e-12 || x < -0.9999 && error < 1e-6, "{error} at {x}");
        }
    }

    #[test]
    fn a_line_has_no_normal() {
        assert!(smallest_eigenvector(&Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0))).is_none());
        assert!(smallest_eigenvector(&Matrix3::zeros()).is_none());
        assert!(smallest_eigenvector(&Matrix3::repeat(f64::NAN)).is_none());
    }
}
