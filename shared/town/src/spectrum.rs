//! Spectra from 400 to 1000 nm, such as the reflectance of a material.

/// First wavelength, nm.
pub const FIRST_NM: f32 = 400.0;
/// Spacing of the samples, nm. Red edge and filters are at least 20 nm wide.
pub const STEP_NM: f32 = 10.0;
/// Samples of a [`Spectrum`].
pub const SAMPLES: usize = 61;

/// Values from 400 to 1000 nm in steps of 10 nm, linear in between. Reflectances are 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum([f32; SAMPLES]);

/// Wavelengths of [`Spectrum::from_anchors`], nm.
pub const ANCHORS_NM: [f32; 11] = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0, 800.0, 900.0, 1000.0];

impl Spectrum {
    /// Spectrum from values at [`ANCHORS_NM`].
    pub fn from_anchors(values: [f32; 11]) -> Self {
        Self::from_fn(|nm| {
            let after = ANCHORS_NM.partition_point(|&a| a <= nm).clamp(1, 10);
            let a = ANCHORS_NM[after - 1];
            let b = ANCHORS_NM[after];
            let share = (nm - a) / (b - a);
            values[after - 1] * (1.0 - share) + values[after] * share
        })
    }
    /// Spectrum of a paint from its reflectance in red, green, blue and infrared.
    pub fn paint([red, green, blue]: [f32; 3], infrared: f32) -> Self {
        let edge = 0.5 * (red + infrared);
        Self::from_anchors([
            blue,
            blue,
            0.5 * (blue + green),
            green,
            0.5 * (green + red),
            red,
            red,
            edge,
            infrared,
            infrared,
            infrared,
        ])
    }
    /// Spectrum sampled from a function of the wavelength in nm.
    pub fn from_fn(value: impl Fn(f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| value(FIRST_NM + STEP_NM * i as f32)))
    }
    /// The values at [`FIRST_NM`] and every [`STEP_NM`] after it.
    pub const fn values(&self) -> &[f32; SAMPLES] {
        &self.0
    }
    /// (wavelength in nm, value), 400 to 1000 nm in steps of 10.
    pub fn samples(&self) -> impl Iterator<Item = (f32, f32)> {
        self.0.iter().enumerate().map(|(i, value)| (FIRST_NM + STEP_NM * i as f32, *value))
    }
    /// The value at a wavelength in nm; outside the range, the value at its end.
    pub fn at(&self, nm: f32) -> f32 {
        let position = ((nm - FIRST_NM) / STEP_NM).clamp(0.0, (SAMPLES - 1) as f32);
        let i = (position as usize).min(SAMPLES - 2);
        let share = position - i as f32;
        self.0[i] * (1.0 - share) + self.0[i + 1] * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectrum_interpolates_anchors_linearly() {
        let mut values = [0.0; 11];
        for (i, v) in values.iter_mut().enumerate() {
            *v = 0.05 * i as f32;
        }
        let spectrum = Spectrum::from_anchors(values);
        for (nm, v) in ANCHORS_NM.iter().zip(values) {
            assert!((spectrum.at(*nm) - v).abs() < 1e-6);
        }
        assert!((spectrum.at(850.0) - 0.425).abs() < 1e-6);
    }
}
