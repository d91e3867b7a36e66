//! scikit-learn from the same start is the reference (`lab/peers/color_lines.py freeze`).

use color_lines::{Gaussian, Points, mixture};

#[derive(serde::Deserialize)]
struct Reference {
    start: Vec<Gaussian>,
    fitted: Vec<Gaussian>,
    iterations: usize,
}

/// Three groups of points from fractional parts, as in the script.
fn points() -> Points {
    let axis = |(k, factor): (usize, f64)| {
        (0..600).map(|i| (f64::from(i) * factor).fract() * 0.2 + if i as usize % 3 == k { 0.3 } else { 0.0 }).collect()
    };
    Points([(0, 0.754_877), (1, 0.569_840), (2, 0.330_598)].map(axis))
}

#[test]
fn fit_from_the_same_start_equals_scikit_learn() {
    let reference: Reference = serde_json::from_str(include_str!("scikit_learn.json")).expect("a reference");
    let found = mixture::fit(&points(), reference.start.clone());
    assert_eq!(found.n_iterations, reference.iterations);
    for (found, expected) in found.gaussians.iter().zip(&reference.fitted) {
        let numbers = |gaussian: &Gaussian| [&[gaussian.weight], &gaussian.mean[..], &gaussian.covariance].concat();
        for (found, expected) in numbers(found).iter().zip(numbers(expected)) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
    }
    let moved = reference.start.iter().zip(&found.gaussians).map(|(start, end)| (start.mean[0] - end.mean[0]).abs());
    assert!(moved.fold(0.0, f64::max) > 0.05, "the start is not a solution");
}
