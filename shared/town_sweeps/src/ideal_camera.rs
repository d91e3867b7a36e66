//! Measurements of an ideal camera at the LiDAR, for the points of a submap: reflectance and texture of the surface in
//! sunlight and skylight, with cast shadows; without noise, automatic gain, parallax or registration errors.

use crate::surface_rays::{N_RAYS, trace_points};
use messages::{SubmapHeader, SubmapPoint};
use simulation::Simulation;
use simulation::sensors::filter::Filter;
use simulation::sensors::look::Palette;
use std::ops::RangeInclusive;

/// Wavelengths of the bands that an ideal camera can have, nm: the range of the material spectra.
pub const BANDS_NM: RangeInclusive<u16> = 400..=1000;

/// Center and standard deviation of the filters of a color camera, nm.
const COLOR_FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Standard deviation of the filter of a band, nm: about 20 nm full width at half maximum, as in the bands of the mosaic
/// cameras.
const BAND_SIGMA_NM: f32 = 8.0;
/// Share of the sky that is visible in a street.
const SKY_VIEW: f32 = 0.6;

/// A camera at the LiDAR that captures every point at the time of its shot.
pub struct IdealCamera {
    palette: Palette,
    n_bands: usize,
    /// Value of a signal; a white target in the sun has the signal 1.
    value: fn(f32) -> f32,
    /// Largest number of rays per point.
    n_rays: u64,
}

impl IdealCamera {
    /// A color camera with red, green and blue values of 0 to 1.
    pub fn color() -> Self {
        let filters = COLOR_FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
        // The square root approximates the sRGB curve.
        Self::new(&filters, |signal| signal.clamp(0.0, 1.0).sqrt())
    }
    /// A camera with reflectances of 0 to 2 in bands at one or more wavelengths in [`BANDS_NM`]. They are relative to a
    /// white target in the sun, as `calibrate` measures them: a surface in the shade has lower values.
    pub fn with_bands(wavelengths_nm: &[u16]) -> Self {
        let filters: Vec<Filter> =
            wavelengths_nm.iter().map(|nm| Filter::gauss(f32::from(*nm), BAND_SIGMA_NM)).collect();
        Self::new(&filters, |signal| signal.clamp(0.0, 2.0))
    }
    fn new(filters: &[Filter], value: fn(f32) -> f32) -> Self {
        // A white target in the sun has the value 1, as after the white balance of the cameras.
        let palette = Palette::new(filters, |sun, sky| sun + 0.4 * sky);
        Self { palette, n_bands: filters.len(), value, n_rays: N_RAYS }
    }
    /// Limits the rays per point; tracing stops at the first ray that hits the surface of the point. The default is 32.
    /// Rays pass through leaves and fences at random: with one ray, most points of vegetation have no value and all
    /// others have one, which would reveal the class.
    #[must_use]
    pub fn with_rays(self, n_rays: u64) -> Self {
        Self { n_rays, ..self }
    }
    /// Number of values of a point.
    pub fn n_bands(&self) -> usize {
        self.n_bands
    }
    /// The values of some points of a submap of a simulation, one point after the other; NaN if no ray hits the surface
    /// of the point. `shown` contains the index of each point.
    pub fn values(
        &self,
        simulation: &Simulation,
        header: &SubmapHeader,
        points: &[SubmapPoint],
        shown: &[usize],
    ) -> Vec<f32> {
        let mut values = vec![f32::NAN; shown.len() * self.n_bands];
        trace_points(simulation, header, points, shown, self.n_rays, |place, hit, sun| {
            let part = self.palette.part(hit, sun, SKY_VIEW, 1.0);
            let of_point = &mut values[place * self.n_bands..][..self.n_bands];
            for (band, value) in of_point.iter_mut().enumerate() {
                *value = (self.value)(self.palette.band(&part, band));
            }
        });
        values
    }
}
