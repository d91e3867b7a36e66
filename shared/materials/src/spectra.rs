//! Measured spectra.

use messages::{SpectraHeader, SpectraView};

/// The spectra of points or pixels. All have the same bands, but not every band of each was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectra {
    /// Center of each band, nm. At most 64 bands.
    pub wavelengths_nm: Vec<f32>,
    /// Bit b of a spectrum: band b was measured.
    pub valid: Vec<u64>,
    /// Reflectances, one spectrum after the other. Values of bands that were not measured have no meaning.
    pub values: Vec<f32>,
}

/// One spectrum.
#[derive(Clone, Copy, Debug)]
pub struct Spectrum<'a> {
    /// Center of each band, nm.
    pub wavelengths_nm: &'a [f32],
    /// Bit b: band b was measured.
    pub valid: u64,
    /// Reflectance of each band.
    pub values: &'a [f32],
}

impl Spectra {
    /// An empty set of spectra with these bands.
    pub fn new(wavelengths_nm: &[f32]) -> Self {
        Self { wavelengths_nm: wavelengths_nm.to_vec(), ..Self::default() }
    }

    /// The spectra of a column, and the index of the point of each spectrum. `None` if the rows do not fit the header.
    pub fn from_column(header: &SpectraHeader, rows: &[u32]) -> Option<(Vec<u32>, Self)> {
        let view = SpectraView::new(header, rows)?;
        let mut spectra = Self::new(header.wavelengths_nm.get(..header.n_bands as usize)?);
        let mut points = Vec::with_capacity(header.n_spectra as usize);
        for point in 0..header.n_points {
            if let Some((valid, values)) = view.spectrum(point as usize) {
                points.push(point);
                spectra.push(valid, values);
            }
        }
        Some((points, spectra))
    }

    /// Appends a spectrum.
    ///
    /// # Panics
    /// If it has another number of bands.
    pub fn push(&mut self, valid: u64, values: &[f32]) {
        assert_eq!(values.len(), self.wavelengths_nm.len(), "reflectances and bands");
        self.valid.push(valid);
        self.values.extend_from_slice(values);
    }

    /// Number of spectra.
    pub fn len(&self) -> usize {
        self.valid.len()
    }

    /// Whether there are no spectra.
    pub fn is_empty(&self) -> bool {
        self.valid.is_empty()
    }

    /// The spectrum of this number.
    pub fn get(&self, index: usize) -> Spectrum<'_> {
        let n_bands = self.wavelengths_nm.len();
        Spectrum {
            wavelengths_nm: &self.wavelengths_nm,
            valid: self.valid[index],
            values: &self.values[index * n_bands..][..n_bands],
        }
    }
}

impl Spectrum<'_> {
    /// Wavelength and reflectance of each band that was measured.
    pub fn measured(&self) -> impl Iterator<Item = (f32, f32)> {
        let pairs = self.wavelengths_nm.iter().zip(self.values).enumerate();
        pairs.filter(|(band, _)| self.valid >> band & 1 == 1).map(|(_, (nm, value))| (*nm, *value))
    }

    /// Mean reflectance of the measured bands of a range of wavelengths, nm.
    fn mean(&self, range_nm: std::ops::Range<f32>) -> Option<f32> {
        let values = self.measured().filter(|(nm, _)| range_nm.contains(nm)).map(|(_, value)| value);
        let (sum, n) = values.fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
        (n > 0).then(|| sum / n as f32)
    }
}

/// Red band of [`ndvi`], nm: the strongest absorption of chlorophyll, before the red edge.
const RED_NM: std::ops::Range<f32> = 640.0..690.0;
/// Near-infrared band of [`ndvi`], nm: after the red edge, before the absorption of water.
const INFRARED_NM: std::ops::Range<f32> = 760.0..900.0;

/// Normalized difference vegetation index, -1 to 1: (infrared - red) / (infrared + red). Green plants are above 0.4.
/// `None` unless a band from 640 to 690 nm and one from 760 to 900 nm were measured and are not both 0.
pub fn ndvi(spectrum: Spectrum<'_>) -> Option<f32> {
    let red = spectrum.mean(RED_NM)?.max(0.0);
    let infrared = spectrum.mean(INFRARED_NM)?.max(0.0);
    let sum = red + infrared;
    (sum > 0.0).then(|| (infrared - red) / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vegetation_index_uses_measured_bands_on_both_sides_of_the_red_edge() {
        let mut spectra = Spectra::new(&[550.0, 670.0, 800.0, 950.0]);
        spectra.push(0b1111, &[0.1, 0.05, 0.45, 0.0]);
        spectra.push(0b1011, &[0.1, 0.05, 0.45, 0.0]);
        spectra.push(0b0110, &[0.0, 0.2, 0.2, 0.0]);
        assert!((ndvi(spectra.get(0)).expect("both") - 0.8).abs() < 1e-6);
        assert_eq!(ndvi(spectra.get(1)), None, "no infrared");
        assert_eq!(ndvi(spectra.get(2)), Some(0.0));
    }
}
