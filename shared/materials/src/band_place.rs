//! Interpolation between the bands of a model.

/// Farthest distance of a band outside of those of the model, nm.
const MARGIN_NM: f32 = 5.0;

/// A band of a camera among those of a model: its two neighbors there, and how near it is to the second.
pub(crate) struct BandPlace {
    first: usize,
    second: usize,
    /// Weight of the second neighbor, 0 to 1.
    weight: f64,
}

impl BandPlace {
    /// Place of a wavelength among those of a model, which ascend; `None` beyond them.
    pub fn of(model_nm: &[f32], nm: f32) -> Option<Self> {
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

    /// A value there, from the values at the bands of the model.
    pub fn value(&self, of_band: impl Fn(usize) -> f64) -> f64 {
        of_band(self.first) * (1.0 - self.weight) + of_band(self.second) * self.weight
    }
}
