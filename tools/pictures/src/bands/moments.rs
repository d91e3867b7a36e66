//! Mean and standard deviation.

/// Mean and standard deviation of the finite values. `None` without finite values.
pub fn moments(values: impl Iterator<Item = f64> + Clone) -> Option<[f64; 2]> {
    let values = values.filter(|value| value.is_finite());
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let square = values.map(|value| (value - mean).powi(2)).sum::<f64>() / n;
    (n > 0.0).then(|| [mean, square.sqrt()])
}
