//! Bias of the accelerometers, separated from the inclination of the odometry.
//!
//! Both tilt the vertical. The inclination keeps its direction in the axes of the odometry, the bias in the axes of the
//! vehicle, so a turn separates them. Differences between the forces of unit and LiDAR are linear in both.

use geometry::{UnitQuaternion, Vector3};
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Unknowns: g times the inclination about the axes y and -x of the odometry, and the bias, m/s^2.
const N: usize = 5;
/// Standard deviation of the inclination before it is measured, m/s^2: 6 degrees, a steep street at the start.
const INCLINATION_MPS2: f64 = 1.0;
/// Standard deviation of a bias before it is measured, m/s^2: a damaged unit.
const BIAS_MPS2: f64 = 1.0;
/// Weight of a pair after one more pair: the last minute at 10 Hz, as for the other comparisons.
const MEMORY: f64 = 1.0 - 1.0 / 600.0;
/// Lower bound for the errors of the pairs, m/s^2, and the number of neighboring pairs that count as one. With 0.3, on suburban
/// nuscenes 1005 and urban nuscenes 1006, the errors of the bias were a third of their standard deviation.
const FORCE_SIGMA: f64 = 0.15;
const FORCES_PER_PAIR: f64 = 10.0;

/// Sums of the normal equations.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct BiasSums {
    n: f64,
    normal: SMatrix<f64, N, N>,
    gradient: SVector<f64, N>,
    square: f64,
}

/// Bias of the accelerometers along the axes of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForceBias {
    /// m/s^2.
    pub mean: Vector3<f64>,
    /// Standard deviation, m/s^2.
    pub sigma: Vector3<f64>,
}

impl BiasSums {
    /// Adds a difference between the forces of unit and LiDAR (body axes, m/s^2).
    pub fn add(&mut self, off: &Vector3<f64>, odom_from_body: &UnitQuaternion<f64>) {
        let body_from_odom = odom_from_body.inverse().to_rotation_matrix();
        let mut design = SMatrix::<f64, 3, N>::zeros();
        design.fixed_view_mut::<3, 2>(0, 0).copy_from(&body_from_odom.matrix().fixed_columns::<2>(0));
        design.fixed_view_mut::<3, 3>(0, 2).fill_with_identity();
        self.n = self.n * MEMORY + 1.0;
        self.normal = self.normal * MEMORY + design.transpose() * design;
        self.gradient = self.gradient * MEMORY + design.transpose() * off;
        self.square = self.square * MEMORY + off.norm_squared();
    }

    /// The bias; `None` without pairs.
    pub fn estimate(&self) -> Option<ForceBias> {
        let solved = |variance: f64| {
            let prior = |sigma: f64| variance / (sigma * sigma);
            let [inclination, bias] = [INCLINATION_MPS2, BIAS_MPS2].map(prior);
            let priors = SVector::<f64, N>::from([inclination, inclination, bias, bias, bias]);
            let inverse = (self.normal + SMatrix::from_diagonal(&priors)).try_inverse()?;
            Some((inverse * self.gradient, inverse))
        };
        let least = FORCE_SIGMA * FORCE_SIGMA * FORCES_PER_PAIR;
        let (first, _) = solved(least)?;
        let residual = (self.square - 2.0 * first.dot(&self.gradient) + first.dot(&(self.normal * first))).max(0.0);
        let variance = (residual / (3.0 * self.n.max(1.0)) * FORCES_PER_PAIR).max(least);
        let (found, inverse) = solved(variance)?;
        (self.n > 0.0).then(|| ForceBias {
            mean: found.fixed_rows::<3>(2).into_owned(),
            sigma: Vector3::from_fn(|axis, _| (inverse[(2 + axis, 2 + axis)] * variance).max(0.0).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIAS: Vector3<f64> = Vector3::new(0.5, -0.2, 0.1);

    /// The estimate of a biased unit on an inclined start, after 20 s in which the heading changes by `turned` rad.
    fn after(turned: f64) -> ForceBias {
        let mut sums = BiasSums::default();
        for pair in 0..200 {
            let heading = turned * f64::from(pair) / 200.0;
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
            let inclination = rotation.inverse() * Vector3::new(0.3, 0.1, 0.0);
            let noise =
                Vector3::from_fn(|axis, _| 0.3 * f64::from(random::gauss(random::hash(pair as u64, axis as u64))));
            sums.add(&(inclination + BIAS + noise), &rotation);
        }
        sums.estimate().expect("pairs")
    }

    #[test]
    fn turn_separates_bias_from_inclination() {
        let ForceBias { mean, sigma } = after(std::f64::consts::PI);
        assert!((mean - BIAS).norm() < 0.1, "{mean}");
        assert!(sigma.max() < 0.12, "{sigma}");
    }

    #[test]
    fn bias_without_a_turn_is_unknown() {
        let ForceBias { mean, sigma } = after(0.0);
        assert!(sigma.x > 0.5 && sigma.y > 0.5, "{sigma}");
        assert!((mean - BIAS).component_div(&sigma).amax() < 3.0, "{mean} {sigma}");
    }
}
