//! Interpolation between the bands of a model.

/// Largest distance of a band from the wavelength range of a model, nm.
const MARGIN_NM: f32 = 5.0;

/// Position of a camera band between the bands of a model: the two neighbors, and the weight of the second.
pub(crate) struct BandPlace {
    first: usize,
    second: usize,
    /// Weight of the second neighbor, 0 to 1.
    weight: f64,
}

impl BandPlace {
    /// Position of a wavelength between the ascending wavelengths of a model; `None` outside them.
    pub fn find(model_nm: &[f32], nm: f32) -> Option<Self> {
        let first = *model_nm.first()?;
        let last = *model_nm.last()?;
        if !(first - MARGIN_NM..=last + MARGIN_NM).contains(&nm) {
            return None;
        }
        let second = model_nm.partition_point(|known| *known < nm).clamp(1, model_nm.len() - 1);
        let first = second - 1;
        let low = model_nm[first];
        let high = model_nm[second];
        Some(Self { first, second, weight: f64::from((nm - low) / (high - low)).clamp(0.0, 1.0) })
    }

    /// Interpolates a value at this position from the values at the bands of the model.
    pub fn value(&self, of_band: impl Fn(usize) -> f64) -> f64 {
        of_band(self.first) * (1.0 - self.weight) + of_band(self.second) * self.weight
    }
}
