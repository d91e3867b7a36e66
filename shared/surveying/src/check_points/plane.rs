//! A plane through points by least squares, from sums.

/// Sums over points.
#[derive(Clone, Debug, Default)]
pub(super) struct PlaneSums {
    n: u64,
    /// Sums of x, y, z.
    first: [f64; 3],
    /// Sums of xx, xy, yy, xz, yz, zz.
    second: [f64; 6],
}

/// Smallest variance of the points along their narrow direction, m²: points on a line have no plane.
const MIN_VARIANCE: f64 = 1e-4;

impl PlaneSums {
    pub(super) fn add(&mut self, [x, y, z]: [f64; 3]) {
        self.n += 1;
        for (sum, value) in self.first.iter_mut().zip([x, y, z]) {
            *sum += value;
        }
        for (sum, value) in self.second.iter_mut().zip([x * x, x * y, y * y, x * z, y * z, z * z]) {
            *sum += value;
        }
    }

    pub(super) fn n_points(&self) -> u64 {
        self.n
    }

    /// Height of the plane at x = y = 0, and standard deviation of the points from it, m. `None` for points on a line.
    pub(super) fn plane(&self) -> Option<(f64, f64)> {
        let n = self.n as f64;
        let [x, y, z] = self.first.map(|sum| sum / n);
        let [xx, xy, yy, xz, yz, zz] = self.second.map(|sum| sum / n);
        let xx = xx - x * x;
        let xy = xy - x * y;
        let yy = yy - y * y;
        let xz = xz - x * z;
        let yz = yz - y * z;
        let zz = zz - z * z;
        let determinant = xx * yy - xy * xy;
        // The smaller eigenvalue is at least the determinant over the trace.
        let is_wide = determinant > MIN_VARIANCE * (xx + yy);
        if !is_wide {
            return None;
        }
        let slope_x = (xz * yy - yz * xy) / determinant;
        let slope_y = (yz * xx - xz * xy) / determinant;
        let variance = zz - slope_x * xz - slope_y * yz;
        Some((z - slope_x * x - slope_y * y, variance.max(0.0).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plane_of_a_slope_is_found_beside_its_points() {
        let mut sums = PlaneSums::default();
        for i in 0..100 {
            let x = f64::from(i % 10) * 0.03 + 0.1;
            let y = f64::from(i / 10) * 0.03 - 0.2;
            // Alternating 5 mm above and below.
            sums.add([x, y, 0.02 + 0.1 * x - 0.3 * y + if (i % 10 + i / 10) % 2 == 0 { 0.005 } else { -0.005 }]);
        }
        let (height, deviation) = sums.plane().expect("has a plane");
        assert!((height - 0.02).abs() < 1e-3 && (deviation - 0.005).abs() < 1e-4, "{height} {deviation}");
    }

    #[test]
    fn points_on_a_line_have_no_plane() {
        let mut sums = PlaneSums::default();
        (0..50).for_each(|i| sums.add([f64::from(i) * 0.01, f64::from(i) * 0.02, 0.0]));
        assert_eq!(sums.plane(), None);
        assert_eq!(PlaneSums::default().plane(), None);
    }
}
