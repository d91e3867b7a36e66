//! Camera measurements at the points of a submap.

use super::CameraBand;
use crate::{ModelInput, SpectraColumn};
use messages::{ColorRow, MAX_BANDS, SpectraView, UNSEEN};

/// Distance from which a measured band has no weight for a wavelength, nm: more than the distance between the bands of
/// a mosaic camera, less than the distance between features of the spectra of materials.
pub const BAND_REACH_NM: f32 = 25.0;

/// The colors and spectra of a submap in the form of model features.
#[derive(Default)]
pub(super) struct CameraColumns<'a> {
    colors: Option<&'a [ColorRow]>,
    spectra: Option<SpectraView<'a>>,
    bands: Vec<Source>,
}

/// Source of the values of a band.
enum Source {
    /// Channel of the color.
    Color(usize),
    /// Weight of each band of the spectra.
    Spectra(Box<[f32; MAX_BANDS]>),
}

impl<'a> CameraColumns<'a> {
    pub(super) fn new(input: &ModelInput<'a>, bands: &[CameraBand]) -> Self {
        let weights = |nm: u16| {
            let mut weights = Box::new([0.0; MAX_BANDS]);
            if let Some(SpectraColumn { header, .. }) = input.spectra {
                let n_bands = (header.n_bands as usize).min(MAX_BANDS);
                for (weight, measured_nm) in weights.iter_mut().zip(&header.wavelengths_nm[..n_bands]) {
                    *weight = (1.0 - (measured_nm - f32::from(nm)).abs() / BAND_REACH_NM).max(0.0);
                }
            }
            weights
        };
        let source = |band: &CameraBand| match *band {
            CameraBand::Red => Source::Color(0),
            CameraBand::Green => Source::Color(1),
            CameraBand::Blue => Source::Color(2),
            CameraBand::Nm(nm) => Source::Spectra(weights(nm)),
        };
        let spectra = input.spectra.and_then(|spectra| spectra.view());
        Self { colors: input.colors, spectra, bands: bands.iter().map(source).collect() }
    }
    pub(super) fn is_empty(&self) -> bool {
        self.bands.is_empty()
    }
    /// Appends the values of a point, NaN where they are unknown.
    pub(super) fn push_point(&self, point: usize, values: &mut Vec<f32>) {
        values.extend(self.bands.iter().map(|band| self.value(band, point).unwrap_or(f32::NAN)));
    }
    /// Appends the values of a pixel without a point.
    pub(super) fn push_nothing(&self, values: &mut Vec<f32>) {
        values.extend(self.bands.iter().map(|_| f32::NAN));
    }
    fn value(&self, band: &Source, point: usize) -> Option<f32> {
        match band {
            Source::Color(channel) => {
                let ColorRow { r, g, b, camera } = self.colors?[point];
                (camera != UNSEEN).then(|| f32::from([r, g, b][*channel]) / 255.0)
            }
            Source::Spectra(weights) => {
                let (measured, reflectances) = self.spectra?.spectrum(point)?;
                resampled(measured, reflectances, weights)
            }
        }
    }
}

/// The weighted mean of the measured bands. `None` if no band has weight.
fn resampled(measured: u64, reflectances: &[f32], weights: &[f32; MAX_BANDS]) -> Option<f32> {
    let mut sum = 0.0;
    let mut total = 0.0;
    for (band, (reflectance, weight)) in reflectances.iter().zip(weights).enumerate() {
        if measured >> band & 1 != 0 && *weight > 0.0 && reflectance.is_finite() {
            sum += weight * reflectance;
            total += weight;
        }
    }
    (total > 0.0).then(|| (sum / total).clamp(0.0, 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_is_mean_of_near_measured_bands() {
        let mut weights = [0.0; MAX_BANDS];
        // Bands of 640, 655 and 700 nm for 650 nm.
        weights[..2].copy_from_slice(&[0.6, 0.8]);
        let reflectances = [0.2, 0.4, 0.9];
        let value = |measured: u64| resampled(measured, &reflectances, &weights);
        assert!((value(0b111).expect("known") - (0.6 * 0.2 + 0.8 * 0.4) / 1.4).abs() < 1e-6);
        assert_eq!([value(0b001), value(0b100), value(0)], [Some(0.2), None, None]);
        assert_eq!(resampled(1, &[f32::NAN], &weights), None);
    }
}
