//! The two camera models: layout and response of their filters.
//!
//! The filters are interference filters on the pixels (Fabry-Pérot). Each has a second, weaker passband, which the
//! rejection filters in front of the sensor and the spectral correction remove. Values are in the range that the
//! manufacturer measured on such sensors; the centers are spread over the ranges of the thesis (2.5.1), from which 16
//! bands of HS03 give 13 and 25 of HS02 give 23.

/// A camera model.
#[derive(Clone, Debug, PartialEq)]
pub struct MosaicModel {
    /// `hs02` or `hs03`.
    pub name: &'static str,
    /// Serial number of its sensor.
    pub sensor_id: &'static str,
    /// Side of the pattern, px.
    pub pattern: usize,
    /// Left column, top row, width and height of the area with filters, px.
    pub active_area: [usize; 4],
    /// Spectral range of the sensor, nm.
    pub range_nm: [f64; 2],
    /// Half-transmission wavelengths of the long-pass and short-pass filters, nm.
    pub rejection_nm: [f64; 2],
    /// Bands without a virtual band: too weak or too similar to other bands.
    pub left_out: &'static [usize],
    filters: &'static [InterferenceFilter],
}

/// Filter of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InterferenceFilter {
    /// Middle of the passband, nm.
    pub center_nm: f32,
    /// Full width at half maximum, nm.
    pub fwhm_nm: f32,
    /// Quantum efficiency at the center, 0 to 1.
    pub efficiency: f32,
    /// The second passband: middle and width in nm, efficiency.
    pub second: [f32; 3],
}

const fn filter(center_nm: f32, fwhm_nm: f32, efficiency: f32, second: [f32; 3]) -> InterferenceFilter {
    InterferenceFilter { center_nm, fwhm_nm, efficiency, second }
}

/// Filters of the HS03, row-major in the pattern, which is not sorted by wavelength.
const HS03: [InterferenceFilter; 16] = [
    filter(478.6, 8.2, 0.118, [633.1, 6.4, 0.021]),
    filter(486.3, 13.1, 0.165, [633.4, 6.4, 0.018]),
    filter(474.2, 7.4, 0.052, [632.8, 6.1, 0.035]),
    filter(631.6, 6.2, 0.080, [474.0, 6.8, 0.022]),
    filter(588.7, 8.9, 0.255, [616.0, 21.0, 0.030]),
    filter(598.9, 9.3, 0.228, [632.1, 8.4, 0.036]),
    filter(574.8, 7.3, 0.220, [617.4, 20.2, 0.030]),
    filter(563.2, 8.2, 0.182, [615.1, 24.0, 0.024]),
    filter(627.5, 9.8, 0.238, [475.1, 7.1, 0.110]),
    filter(492.4, 10.6, 0.170, [631.8, 6.4, 0.090]),
    filter(620.3, 17.6, 0.236, [474.6, 6.4, 0.045]),
    filter(610.2, 13.0, 0.246, [474.9, 6.4, 0.024]),
    filter(525.9, 7.3, 0.231, [631.0, 8.1, 0.022]),
    filter(538.1, 7.4, 0.176, [631.5, 6.9, 0.020]),
    filter(511.4, 8.7, 0.212, [631.2, 7.6, 0.019]),
    filter(500.6, 11.9, 0.181, [631.4, 7.2, 0.020]),
];

/// Filters of the HS02, row-major in the pattern; see [`HS03`].
const HS02: [InterferenceFilter; 25] = [
    filter(907.4, 17.2, 0.043, [846.0, 23.0, 0.010]),
    filter(918.8, 18.6, 0.046, [860.1, 21.0, 0.011]),
    filter(930.1, 19.4, 0.044, [874.9, 24.0, 0.011]),
    filter(942.6, 22.0, 0.034, [889.2, 25.0, 0.010]),
    filter(955.3, 20.5, 0.027, [900.4, 25.0, 0.009]),
    filter(844.2, 15.1, 0.070, [781.0, 17.8, 0.010]),
    filter(857.9, 14.6, 0.076, [796.2, 18.8, 0.011]),
    filter(871.0, 17.9, 0.062, [808.0, 19.3, 0.012]),
    filter(883.3, 18.4, 0.053, [821.4, 18.6, 0.013]),
    filter(895.6, 19.0, 0.046, [834.8, 24.0, 0.014]),
    filter(771.7, 10.8, 0.078, [829.6, 24.0, 0.013]),
    filter(787.2, 11.0, 0.091, [845.3, 21.4, 0.009]),
    filter(802.1, 12.0, 0.088, [738.3, 13.4, 0.010]),
    filter(816.8, 13.1, 0.088, [752.2, 13.9, 0.011]),
    filter(830.6, 14.0, 0.084, [767.0, 20.1, 0.011]),
    filter(690.5, 7.6, 0.055, [748.8, 17.1, 0.010]),
    filter(706.8, 8.6, 0.047, [768.3, 18.1, 0.008]),
    filter(723.4, 8.5, 0.080, [785.0, 19.0, 0.008]),
    filter(739.6, 8.7, 0.081, [801.2, 19.2, 0.009]),
    filter(755.9, 9.4, 0.084, [817.3, 19.4, 0.009]),
    filter(968.4, 24.0, 0.008, [612.4, 14.1, 0.006]),
    filter(974.9, 25.0, 0.007, [621.0, 6.6, 0.008]),
    filter(622.6, 8.0, 0.038, [684.0, 12.4, 0.007]),
    filter(648.3, 8.6, 0.032, [711.3, 12.8, 0.007]),
    filter(672.9, 8.4, 0.043, [734.6, 13.2, 0.008]),
];

impl MosaicModel {
    /// 25 bands from 600 to 975 nm.
    pub const fn hs02() -> Self {
        Self {
            name: "hs02",
            sensor_id: "13.8.0.2",
            pattern: 5,
            active_area: [0, 0, 2045, 1085],
            range_nm: [600.0, 975.0],
            rejection_nm: [604.0, 988.0],
            left_out: &[20, 21],
            filters: &HS02,
        }
    }
    /// 16 bands from 470 to 630 nm.
    pub const fn hs03() -> Self {
        Self {
            name: "hs03",
            sensor_id: "9.4.0.3",
            pattern: 4,
            active_area: [0, 32, 2048, 1024],
            range_nm: [470.0, 630.0],
            rejection_nm: [467.0, 641.0],
            left_out: &[2, 3, 10],
            filters: &HS03,
        }
    }
    /// The filters, row-major in the pattern.
    pub const fn bands(&self) -> &'static [InterferenceFilter] {
        self.filters
    }
    /// Columns and rows of pattern cells.
    pub const fn cells(&self) -> [usize; 2] {
        [self.active_area[2] / self.pattern, self.active_area[3] / self.pattern]
    }
}

impl InterferenceFilter {
    /// Quantum efficiency at a wavelength in nm: both passbands (Airy functions near their peaks) and broadband leakage.
    pub fn response(&self, nm: f64) -> f64 {
        let pass = |center: f32, fwhm: f32, peak: f32| {
            f64::from(peak) / (1.0 + ((nm - f64::from(center)) / (0.5 * f64::from(fwhm))).powi(2))
        };
        let [center, fwhm, peak] = self.second;
        pass(self.center_nm, self.fwhm_nm, self.efficiency) + pass(center, fwhm, peak) + 4e-4
    }
}
