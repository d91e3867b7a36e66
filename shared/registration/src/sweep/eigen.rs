//! Eigenvalues of symmetric 3x3 matrices in closed form (O. K. Smith, CACM 4(4), 1961).

/// Upper triangle of a symmetric matrix: xx, xy, xz, yy, yz, zz.
pub(crate) type Symmetric = [f64; 6];

/// Eigenvalues from largest to smallest, and the unit eigenvector of the smallest. The vector is zero if it is
/// undetermined (two small eigenvalues are equal, or numbers are not finite). The code is branch-free, so that a loop
/// over matrices vectorizes; nalgebra's solver does not.
#[inline(always)]
pub(crate) fn smallest_eigenvector(m: &Symmetric) -> ([f64; 3], [f64; 3]) {
    let values = eigenvalues(m);
    let [xx, xy, xz, yy, yz, zz] = *m;
    let xx = xx - values[2];
    let yy = yy - values[2];
    let zz = zz - values[2];
    // Rows of the shifted matrix span the plane normal to the eigenvector; the longest cross product is the most accurate.
    let ax = xy * yz - xz * yy;
    let ay = xz * xy - xx * yz;
    let az = xx * yy - xy * xy;
    let bx = yy * zz - yz * yz;
    let by = yz * xz - xy * zz;
    let bz = xy * yz - yy * xz;
    let cx = yz * xz - zz * xy;
    let cy = zz * xx - xz * xz;
    let cz = xz * xy - yz * xx;
    let aa = ax * ax + ay * ay + az * az;
    let bb = bx * bx + by * by + bz * bz;
    let cc = cx * cx + cy * cy + cz * cz;
    let (x, y, z, square) = if bb >= aa { (bx, by, bz, bb) } else { (ax, ay, az, aa) };
    let (x, y, z, square) = if cc >= square { (cx, cy, cz, cc) } else { (x, y, z, square) };
    let norm = square.sqrt();
    // The cross product is of the order of (l1 - l3)(l2 - l3). The arc cosine loses half the digits of the differences, so a
    // product below 1e-6 of l1^2 may be rounding. A zero matrix has no eigenvector.
    let is_determined = (norm > 1e-6 * values[0] * values[0]) & (norm > 1e-40) & (norm < f64::MAX);
    let per_norm = if is_determined { 1.0 / norm } else { 0.0 };
    (values, if is_determined { [x * per_norm, y * per_norm, z * per_norm] } else { [0.0; 3] })
}

#[inline(always)]
fn eigenvalues(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> [f64; 3] {
    let q = (xx + yy + zz) / 3.0;
    let a = xx - q;
    let b = yy - q;
    let c = zz - q;
    let p = ((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0).sqrt().max(1e-30);
    let det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let half_det = (det / (p * p * p) / 2.0).clamp(-1.0, 1.0);
    // The values are q + 2 p c with 4 c^3 - 3 c = half_det. For a plane the smallest is the most accurate.
    let smallest = -cosine_of_third(-half_det);
    let root = (smallest * smallest - half_det / smallest).max(0.0).sqrt();
    let largest = 0.5 * (root - smallest);
    let largest = q + 2.0 * p * largest;
    let smallest = q + 2.0 * p * smallest;
    [largest, 3.0 * q - largest - smallest, smallest]
}

/// cos(acos(x) / 3), the largest root of 4 c^3 - 3 c = x for x in -1 to 1, by Newton's method: a third of the time of
/// the arc cosine and the cosine. Near -1, a double root, the error is the square root of the rounding error.
#[inline(always)]
fn cosine_of_third(x: f64) -> f64 {
    // With u = cos(acos(x) / 2) the root is nearly a parabola.
    let u = (0.5 + 0.5 * x).max(0.0).sqrt();
    let mut c = 0.5 + u * (0.564 - 0.064 * u);
    for _ in 0..3 {
        let slope = 12.0 * c * c - 3.0;
        let step = (c * (4.0 * c * c - 3.0) - x) / slope;
        c = if slope < 1e-9 { 0.5 } else { c - step };
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{UnitQuaternion, Vector3};
    use nalgebra::Matrix3;

    fn triangle(m: &Matrix3<f64>) -> Symmetric {
        [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]]
    }

    #[test]
    fn eigenvalues_of_a_rotated_diagonal_matrix_are_its_diagonal() {
        for (i, axis) in
            [Vector3::new(0.3, -0.2, 0.9), Vector3::new(1.5, 0.1, 0.0), Vector3::zeros()].iter().enumerate()
        {
            let r = UnitQuaternion::from_scaled_axis(*axis).to_rotation_matrix();
            let diagonal = Vector3::new(0.5, 0.02 + i as f64, 0.0004);
            let m = r.matrix() * Matrix3::from_diagonal(&diagonal) * r.matrix().transpose();
            let (values, vector) = smallest_eigenvector(&triangle(&m));
            let mut expected = [diagonal.x, diagonal.y, diagonal.z];
            expected.sort_by(|a, b| b.total_cmp(a));
            for (value, expected) in values.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-9, "{values:?}");
            }
            assert!((Vector3::from(vector).dot(&r.matrix().column(2)).abs() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn newton_root_equals_the_cosine() {
        for i in 0..=2000 {
            let x = f64::from(i) / 1000.0 - 1.0;
            let error = (cosine_of_third(x) - (x.acos() / 3.0).cos()).abs();
            assert!(error < 1e-12 || x < -0.9999 && error < 1e-6, "{error} at {x}");
        }
    }

    #[test]
    fn degenerate_matrix_has_no_eigenvector() {
        for m in [Matrix3::from_diagonal(&Vector3::x()), Matrix3::zeros(), Matrix3::repeat(f64::NAN)] {
            assert_eq!(smallest_eigenvector(&triangle(&m)).1, [0.0; 3]);
        }
    }
}
