//! Gaussian mixtures fitted by expectation maximization from a given start.
//!
//! This is a custom implementation, because no crate for mixtures accepts initial means. The result equals scikit-learn's
//! `GaussianMixture` with full covariances from the same start (`tests/suite/peer.rs`).

use crate::blocks::{Share, classify, expectation};
use crate::gaussian::{Gaussian, Normalized, REGULARIZATION};
use crate::space::Points;

/// Limit of the iterations: the default of scikit-learn.
const MAX_ITERATIONS: usize = 100;
const TOLERANCE: f64 = 1e-3;

/// A fitted mixture.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// Gaussians, in the order of the start.
    pub gaussians: Vec<Gaussian>,
    /// Iterations until the mean logarithmic density changed by less than the tolerance.
    pub n_iterations: usize,
}

/// The start of a fit: each point belongs to the nearest mean; weights and covariances around the means are computed from
/// these points.
pub fn start(points: &Points, means: &[[f64; 3]]) -> Vec<Gaussian> {
    let nearest = nearest(points, means);
    let mut shares = vec![Share::default(); means.len()];
    for (index, of) in nearest.iter().enumerate() {
        let point = points.at(index);
        let mean = means[*of as usize];
        let [x, y, z] = [0, 1, 2].map(|k| point[k] - mean[k]);
        let terms = [1.0, 0.0, 0.0, 0.0, x * x, x * y, x * z, y * y, y * z, z * z];
        shares[*of as usize].sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
    maximization(means, &shares)
}

/// The nearest mean of each point.
pub(crate) fn nearest(points: &Points, means: &[[f64; 3]]) -> Vec<u32> {
    let sphere = |mean: &[f64; 3]| Normalized { mean: *mean, factor: [1.0, 0.0, 1.0, 0.0, 0.0, 1.0], constant: 0.0 };
    classify(points, &means.iter().map(sphere).collect::<Vec<_>>())
}

/// Fits a mixture to at least one point.
pub fn fit(points: &Points, start: Vec<Gaussian>) -> Mixture {
    let mut gaussians = start;
    let mut before = f64::NEG_INFINITY;
    for n_iterations in 1..=MAX_ITERATIONS {
        let mut shares = vec![Share::default(); gaussians.len()];
        let log_likelihood = expectation(points, &normalized(&gaussians), &mut shares) / points.len() as f64;
        let means: Vec<[f64; 3]> = gaussians.iter().map(|gaussian| gaussian.mean).collect();
        gaussians = maximization(&means, &shares);
        if (log_likelihood - before).abs() < TOLERANCE {
            return Mixture { gaussians, n_iterations };
        }
        before = log_likelihood;
    }
    Mixture { gaussians, n_iterations: MAX_ITERATIONS }
}

/// Gaussians with their weights in the densities.
pub(crate) fn normalized(gaussians: &[Gaussian]) -> Vec<Normalized> {
    // The regularization keeps covariances positive definite; a Gaussian whose covariance is not gets zero density.
    let none = Normalized { mean: [0.0; 3], factor: [0.0; 6], constant: f64::NEG_INFINITY };
    gaussians.iter().map(|gaussian| gaussian.normalized(gaussian.weight).unwrap_or(none)).collect()
}

/// The Gaussians computed from these shares, which are relative to `means`.
fn maximization(means: &[[f64; 3]], shares: &[Share]) -> Vec<Gaussian> {
    // As in scikit-learn: a Gaussian without points keeps its mean.
    let count = |share: &Share| share.sums[0] + 10.0 * f64::EPSILON;
    let total: f64 = shares.iter().map(count).sum();
    let gaussian = |(mean, share): (&[f64; 3], &Share)| {
        let n = count(share);
        let [_, x, y, z, xx, xy, xz, yy, yz, zz] = share.sums.map(|sum| sum / n);
        Gaussian {
            weight: n / total,
            mean: [mean[0] + x, mean[1] + y, mean[2] + z],
            covariance: [
                xx - x * x + REGULARIZATION,
                xy - x * y,
                xz - x * z,
                yy - y * y + REGULARIZATION,
                yz - y * z,
                zz - z * z + REGULARIZATION,
            ],
        }
    };
    means.iter().zip(shares).map(gaussian).collect()
}
