//! Gaussians and their logarithmic densities.

use serde::{Deserialize, Serialize};

/// Added to the variances of a covariance, in squares of the units of the space, as scikit-learn does. In images of 8 bits it is about
/// the variance of the rounding, (1/255)^2 / 12.
pub const REGULARIZATION: f64 = 1e-6;

/// A Gaussian in the space, with its weight in a mixture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gaussian {
    /// Weight, above 0; the weights of a mixture sum to 1.
    pub weight: f64,
    /// Center.
    pub mean: [f64; 3],
    /// Covariances xx, xy, xz, yy, yz, zz.
    pub covariance: [f64; 6],
}

/// Precomputed terms of a density: log density = constant - |factor (x - mean)|^2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normalized {
    pub mean: [f64; 3],
    /// Rows of a lower triangle: [0], [1, 2], [3, 4, 5].
    pub factor: [f64; 6],
    pub constant: f64,
}

/// ln(2 pi).
const LN_2_PI: f64 = 1.837_877_066_409_345_5;

impl Gaussian {
    /// Precomputes the inverse of the Cholesky factor of the covariance, with the logarithm of `weight` in the constant.
    /// `None` if the covariance is not positive definite.
    pub(crate) fn normalized(&self, weight: f64) -> Option<Normalized> {
        let [xx, xy, xz, yy, yz, zz] = self.covariance;
        let root = |value: f64| (value > 0.0 && value.is_finite()).then(|| value.sqrt());
        let a = root(xx)?;
        let b = xy / a;
        let d = xz / a;
        let c = root(yy - b * b)?;
        let e = (yz - d * b) / c;
        let f = root(zz - d * d - e * e)?;
        // Inverse of the lower triangle [a; b c; d e f].
        let ia = 1.0 / a;
        let ic = 1.0 / c;
        let i_f = 1.0 / f;
        let ib = -b * ia * ic;
        let ie = -e * ic * i_f;
        let id = -(d * ia + e * ib) * i_f;
        let constant = weight.ln() - 1.5 * LN_2_PI - (a * c * f).ln();
        // The factor 1/2 of the exponent is part of the factor.
        let factor = [ia, ib, ic, id, ie, i_f].map(|value| value * std::f64::consts::FRAC_1_SQRT_2);
        Some(Normalized { mean: self.mean, factor, constant })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalized_density_equals_the_formula() {
        let gaussian =
            Gaussian { weight: 1.0, mean: [0.1, 0.2, 0.3], covariance: [0.04, 0.01, -0.006, 0.09, 0.02, 0.0625] };
        let Normalized { mean, factor, constant } = gaussian.normalized(0.5).expect("positive definite");
        let point = [0.3, -0.1, 0.5];
        let d = [0, 1, 2].map(|k| point[k] - mean[k]);
        let y = [
            factor[0] * d[0],
            factor[1] * d[0] + factor[2] * d[1],
            factor[3] * d[0] + factor[4] * d[1] + factor[5] * d[2],
        ];
        let found = constant - y.iter().map(|y| y * y).sum::<f64>();
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
        let matrix = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let d = nalgebra::Vector3::from(d);
        let square = (d.transpose() * matrix.try_inverse().expect("regular") * d)[0];
        let expected = 0.5_f64.ln() - 0.5 * (square + (std::f64::consts::TAU.powi(3) * matrix.determinant()).ln());
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        assert!(Gaussian { covariance: [1.0, 2.0, 0.0, 1.0, 0.0, 1.0], ..gaussian }.normalized(1.0).is_none());
    }
}
