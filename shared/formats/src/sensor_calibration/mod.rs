//! Calibration files of snapshot-mosaic cameras, delivered by the manufacturer for each serial number: XML with the root
//! `sensor_calibration`, in four generations (attribute `version` of the root, 0 to 3).
//!
//! Band k of a pattern of P x P pixels belongs to pixel (x, y) of the active area with `k = (y mod P) P + (x mod P)`. All
//! vectors by band, including the rows of the correction matrices, are ordered by k, never by wavelength.
//!
//! | generation | band responses | rejection filters | correction | vectors |
//! |---|---|---|---|---|
//! | 0 | `filter_info/bands` | `rejection_filter` | `filter_info/spectral_correction_info` | in a child `data` |
//! | 1 | `filter_zones/filter_zone/bands` | `system_info/optical_components` | `system_info/spectral_correction_info` | the element's text |
//! | 2 | as 1, at `sample_points_nm` | | | text or attribute `values` |
//! | 3 | as 2, sizes are `width_px`, `height_px` | | | attribute `values` |

mod curve;
mod read;
mod write;
mod xml;

pub use curve::Curve;

/// Error of a file that is not a calibration of a mosaic camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, {element}: {rule}")]
pub struct SensorCalibrationError {
    /// Line in the file, from 1.
    pub line: u32,
    /// Path of the element, for example `sensor_calibration/sensor_info/width`.
    pub element: String,
    /// The value found and the value expected.
    pub rule: String,
}

/// Content of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorCalibration {
    /// Generation, 0 to 3.
    pub version: u32,
    /// Serial number of the sensor; empty in generation 0, which does not contain it.
    pub sensor_id: String,
    /// Columns and rows of the raw image, px.
    pub size: [u32; 2],
    /// Bits of a sample, if given.
    pub bit_depth: Option<u32>,
    /// Full-well capacity, electrons, if given.
    pub full_well_electrons: Option<f64>,
    /// Left column, top row, width and height of the area with filters, px.
    pub active_area: [u32; 4],
    /// Side of the filter pattern, px: 1 to 16.
    pub pattern: u32,
    /// Specified spectral range, nm.
    pub spectral_range_nm: [f64; 2],
    /// Bands, one for each cell of the pattern, row-major.
    pub bands: Vec<FilterBand>,
    /// Optical components in front of the filters.
    pub optical_components: Vec<OpticalComponent>,
    /// Spectral corrections.
    pub matrices: Vec<CorrectionMatrix>,
}

/// The filter of one cell of the pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterBand {
    /// Whether the manufacturer recommends the band.
    pub selected: bool,
    /// Passbands, the strongest first.
    pub peaks: Vec<Peak>,
    /// Quantum efficiency including the filter by wavelength: 0 to 1 (percent in generation 0).
    pub response: Curve,
}

/// A passband of an interference filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Center, nm.
    pub wavelength_nm: f64,
    /// Full width at half maximum, nm.
    pub fwhm_nm: f64,
    /// Quantum efficiency at the center, in the unit of the response; 0 if not given.
    pub quantum_efficiency: f64,
    /// Fraction of the signal of the band, 0 to 1; 0 if not given.
    pub contribution: f64,
}

/// A filter or lens in front of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct OpticalComponent {
    /// Type, for example `longpass_filter`.
    pub kind: String,
    /// Short name of the manufacturer.
    pub tag: String,
    /// Transmission by wavelength, 0 to 1.
    pub transmission: Curve,
}

/// A matrix that converts the bands of the pattern to virtual bands with one peak each.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectionMatrix {
    /// Name, for example `hsi`.
    pub name: String,
    /// Type. `hyperspectral` and `reflectance` apply to reflectances; every row sums to 1. `irradiance`, `rgb` and others apply to
    /// signals.
    pub kind: String,
    /// Rows, sorted by wavelength.
    pub virtual_bands: Vec<VirtualBand>,
}

/// One row of a correction matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualBand {
    /// Center of the virtual band, nm.
    pub wavelength_nm: f64,
    /// Full width at half maximum, nm; 0 if not given.
    pub fwhm_nm: f64,
    /// Coefficients, one for each band of the pattern.
    pub coefficients: Vec<f64>,
}

impl SensorCalibration {
    /// Reads a file of any generation.
    pub fn from_xml(text: &str) -> Result<Self, SensorCalibrationError> {
        read::sensor_calibration(text)
    }

    /// Content of a file of generation 1 (the generation of the sensors HS02 and HS03), independent of [`Self::version`].
    /// Values in the units of generation 0 are not converted.
    pub fn to_xml(&self) -> String {
        write::xml(self)
    }

    /// System response of band k: its response times the transmissions of all optical components, at the wavelengths of the response.
    pub fn system_response(&self, k: usize) -> Option<Curve> {
        let response = &self.bands.get(k)?.response;
        let through = |nm: f64| self.optical_components.iter().map(|c| c.transmission.at(nm)).product::<f64>();
        let samples = response.samples().map(|(nm, value)| (nm, value * through(nm)));
        Some(Curve::from_samples(samples.collect()))
    }

    /// The correction matrix for reflectances: of type `reflectance` or `hyperspectral`.
    pub fn reflectance_matrix(&self) -> Option<&CorrectionMatrix> {
        let of = |kind: &str| self.matrices.iter().find(|matrix| matrix.kind == kind);
        of("reflectance").or_else(|| of("hyperspectral"))
    }
}

impl FilterBand {
    /// Center of the strongest passband, nm: of the first peak, or the maximum of the response.
    pub fn wavelength_nm(&self) -> f64 {
        self.peaks.first().map_or_else(|| self.response.peak_nm(), |peak| peak.wavelength_nm)
    }
}
