//! A function of the wavelength.

/// Samples by increasing wavelength: linear interpolation between them, constant outside. Never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve(Vec<(f64, f64)>);

impl Curve {
    /// A curve through (wavelength in nm, value), wavelengths increasing. Without samples the curve is zero.
    pub fn from_samples(samples: Vec<(f64, f64)>) -> Self {
        if samples.is_empty() { Self(vec![(0.0, 0.0)]) } else { Self(samples) }
    }

    /// Samples (wavelength in nm, value), wavelengths increasing.
    pub fn samples(&self) -> impl Iterator<Item = (f64, f64)> {
        self.0.iter().copied()
    }

    /// Number of samples.
    pub fn n_samples(&self) -> usize {
        self.0.len()
    }

    /// The value at a wavelength in nm.
    pub fn at(&self, nm: f64) -> f64 {
        let after = self.0.partition_point(|sample| sample.0 <= nm);
        match (after.checked_sub(1).and_then(|before| self.0.get(before)), self.0.get(after)) {
            (Some((a, at_a)), Some((b, at_b))) => at_a + (at_b - at_a) * (nm - a) / (b - a),
            (Some((_, end)), None) | (None, Some((_, end))) => *end,
            (None, None) => 0.0,
        }
    }

    /// Area under the curve by the trapezoidal rule, nm.
    pub fn area(&self) -> f64 {
        self.0.windows(2).map(|pair| 0.5 * (pair[0].1 + pair[1].1) * (pair[1].0 - pair[0].0)).sum()
    }

    /// Wavelength of the largest sample, nm.
    pub fn peak_nm(&self) -> f64 {
        let first = self.0.first().copied().unwrap_or_default();
        self.0.iter().fold(first, |best, sample| if sample.1 > best.1 { *sample } else { best }).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_is_linear_between_samples_and_constant_outside() {
        let curve = Curve::from_samples(vec![(400.0, 0.0), (500.0, 1.0), (520.0, 0.5)]);
        for (nm, value) in [(300.0, 0.0), (400.0, 0.0), (450.0, 0.5), (500.0, 1.0), (510.0, 0.75), (900.0, 0.5)] {
            assert!((curve.at(nm) - value).abs() < 1e-12, "{nm}");
        }
        assert!((curve.area() - 65.0).abs() < 1e-12 && curve.peak_nm() == 500.0);
        assert_eq!(Curve::from_samples(Vec::new()).at(500.0), 0.0);
    }
}
