//! The calibration file of a snapshot-mosaic camera, as its maker delivers it with every serial number: `sensor_calibration`,
//! XML, in four generations (attribute `version` of the root, 0 to 3).
//!
//! Band k of a pattern of P x P pixels belongs to pixel (x, y) of the active area with `k = (y mod P) P + (x mod P)`. All
//! vectors by band, the rows of the correction matrices among them, are ordered by k and never by wavelength.
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

/// Why a file is no calibration of a mosaic camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, {element}: {rule}")]
pub struct SensorCalibrationError {
    /// Line in the file, from 1.
    pub line: u32,
    /// Path of the element, for example `sensor_calibration/sensor_info/width`.
    pub element: String,
    /// What was found and what must be there.
    pub rule: String,
}

/// All that a file says which is of use later.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorCalibration {
    /// Generation, 0 to 3.
    pub version: u32,
    /// Serial number of the sensor; empty if the file has none (generation 0).
    pub sensor_id: String,
    /// Columns and rows of the raw image, px.
    pub size: [u32; 2],
    /// Bits of a sample, if the file says so.
    pub bit_depth: Option<u32>,
    /// Electrons that fill a pixel, if the file says so.
    pub full_well_electrons: Option<f64>,
    /// Left column, top row, width and height of the area with filters, px.
    pub active_area: [u32; 4],
    /// Side of the filter pattern, px: 1 to 16.
    pub pattern: u32,
    /// Shortest and longest wavelength that the sensor is sold for, nm.
    pub spectral_range_nm: [f64; 2],
    /// One for each cell of the pattern, row-major.
    pub bands: Vec<FilterBand>,
    /// What the light passes on its way to the filters.
    pub optical_components: Vec<OpticalComponent>,
    /// Spectral corrections.
    pub matrices: Vec<CorrectionMatrix>,
}

/// The filter of one cell of the pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterBand {
    /// The maker vouches for it.
    pub selected: bool,
    /// Where it lets light through, the strongest first.
    pub peaks: Vec<Peak>,
    /// Quantum efficiency with the filter by wavelength: 0 to 1 (percent in generation 0).
    pub response: Curve,
}

/// A passband of an interference filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its middle, nm.
    pub wavelength_nm: f64,
    /// Full width at half maximum, nm.
    pub fwhm_nm: f64,
    /// Quantum efficiency there, in the unit of the response; 0 if the file does not say.
    pub quantum_efficiency: f64,
    /// Share of the band's signal, 0 to 1; 0 if the file does not say.
    pub contribution: f64,
}

/// A filter or lens before the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct OpticalComponent {
    /// For example `longpass_filter`.
    pub kind: String,
    /// The maker's short name of it.
    pub tag: String,
    /// Transmission by wavelength, 0 to 1.
    pub transmission: Curve,
}

/// A matrix that turns the bands of the pattern into bands with one peak each.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectionMatrix {
    /// For example `hsi`.
    pub name: String,
    /// `hyperspectral` or `reflectance`: every row sums to 1, for reflectances. `irradiance`, `rgb` and others are for
    /// signals.
    pub kind: String,
    /// Rows, by wavelength.
    pub virtual_bands: Vec<VirtualBand>,
}

/// One row of a correction matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualBand {
    /// Middle of the corrected band, nm.
    pub wavelength_nm: f64,
    /// Full width at half maximum, nm; 0 if the file does not say.
    pub fwhm_nm: f64,
    /// One for each band of the pattern, in the pattern's order.
    pub coefficients: Vec<f64>,
}

impl SensorCalibration {
    /// Reads a file of any generation. The error names element and line.
    pub fn from_xml(text: &str) -> Result<Self, SensorCalibrationError> {
        read::sensor_calibration(text)
    }

    /// The file in generation 1, that of the sensors HS02 and HS03, whatever [`Self::version`] says. Generation 0's other
    /// units stay as they are.
    pub fn to_xml(&self) -> String {
        write::xml(self)
    }

    /// What reaches the signal of band k: its response times the transmissions of all optical components, at the
    /// wavelengths of the response.
    pub fn system_response(&self, k: usize) -> Option<Curve> {
        let response = &self.bands.get(k)?.response;
        let through = |nm: f64| self.optical_components.iter().map(|c| c.transmission.at(nm)).product::<f64>();
        let samples = response.samples().map(|(nm, value)| (nm, value * through(nm)));
        Some(Curve::from_samples(samples.collect()))
    }

    /// The matrix for reflectances: of kind `reflectance` or `hyperspectral`.
    pub fn reflectance_matrix(&self) -> Option<&CorrectionMatrix> {
        let of = |kind: &str| self.matrices.iter().find(|matrix| matrix.kind == kind);
        of("reflectance").or_else(|| of("hyperspectral"))
    }
}

impl FilterBand {
    /// Middle of the strongest passband, nm: that of the first peak, or where the response is highest.
    pub fn wavelength_nm(&self) -> f64 {
        self.peaks.first().map_or_else(|| self.response.peak_nm(), |peak| peak.wavelength_nm)
    }
}
