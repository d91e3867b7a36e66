//! Spectral response of a sensor band.

use town::spectrum::{FIRST_NM, SAMPLES, STEP_NM, Spectrum};

/// Response of a band as weights of the samples of a [`Spectrum`]. Exact for spectra that are linear between their samples,
/// however narrow the band.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter([f32; SAMPLES]);

impl Filter {
    /// A Gaussian filter of area 1.
    pub fn gauss(center_nm: f32, sigma_nm: f32) -> Self {
        let filter = Self::from_fn(|nm| {
            let off = (nm - f64::from(center_nm)) / f64::from(sigma_nm);
            (-0.5 * off * off).exp()
        });
        let area: f32 = filter.0.iter().sum();
        Self(filter.0.map(|weight| weight / area))
    }
    /// A filter from its response by wavelength, sampled at every nm from 400 to 1000 nm.
    pub fn from_fn(response: impl Fn(f64) -> f64) -> Self {
        let mut weights = [0.0_f64; SAMPLES];
        for step in 0..=(SAMPLES - 1) * STEP_NM as usize {
            let position = step as f64 / f64::from(STEP_NM);
            let i = (position as usize).min(SAMPLES - 2);
            let share = position - i as f64;
            let value = response(f64::from(FIRST_NM) + step as f64);
            weights[i] += value * (1.0 - share);
            weights[i + 1] += value * share;
        }
        Self(weights.map(|weight| weight as f32))
    }
    /// Signal of a surface under a light, if the filter's area is 1.
    pub fn signal(&self, reflectance: &Spectrum, light: &Spectrum) -> f32 {
        let samples = self.0.iter().zip(reflectance.values().iter().zip(light.values()));
        samples.map(|(weight, (value, light))| weight * value * light).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filter_signal_comes_from_wavelengths_near_its_center() {
        let flat = Spectrum::from_fn(|_| 0.4);
        let white = Spectrum::from_fn(|_| 1.0);
        assert!((Filter::gauss(700.0, 8.0).signal(&flat, &white) - 0.4).abs() < 1e-6);
        let edge = Spectrum::from_fn(|nm| if nm > 700.0 { 1.0 } else { 0.0 });
        let below = Filter::gauss(670.0, 8.0);
        let above = Filter::gauss(730.0, 8.0);
        assert!(below.signal(&edge, &white) < 0.01 && above.signal(&edge, &white) > 0.99);
        // Also where the filter is narrower than the steps of the spectrum.
        let rise = Spectrum::from_fn(|nm| nm / 1000.0);
        let narrow = Filter::gauss(634.0, 2.0);
        assert!((narrow.signal(&rise, &white) - 0.634).abs() < 1e-4);
    }
}
