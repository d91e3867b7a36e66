//! Raw frames into reflectance (thesis 2.5.1):
//!
//! `R = rho_white (raw - dark) / (white - dark) * t_white / t_raw`, per pixel of the raw mosaic.
//!
//! The dark reference is subtracted as it is, whatever its exposure time: at a few ms it is the bias of the read-out, which
//! does not grow with time. R is linear in the light, not clamped: 1 is a perfect diffuser, a mirror gives more, and
//! noise around black gives small negative values, which a clamp would turn into a bias of every mean.
//!
//! A sample that says nothing is masked and its reflectance is 0, never NaN:
//! - dead: `white - dark` is below one count, or one of the references is saturated there;
//! - saturated: the largest value of the sample's depth;
//! - clipped: 0 where the dark reference is above 0, so that the light was anywhere below.

use crate::mosaic::check_length;
use crate::{Mosaic, Reference, SpectralError};
use ndarray::{Array2, ArrayViewMut2};

/// `white - dark` below one count is no light.
const MIN_SIGNAL: f32 = 1.0;

/// The target that the white reference shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteTarget {
    /// Reflectance of the target, above 0 and at most 1; 0.98 for the usual panel.
    pub reflectance: f64,
    /// Exposure time of the white frames, ns.
    pub exposure_nanos: u64,
}

/// What happened to the samples of one frame. Each sample is counted under the first that applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Without usable references.
    pub dead: u64,
    /// At the largest value.
    pub saturated: u64,
    /// At zero, below the dark reference.
    pub clipped: u64,
}

impl FrameCounts {
    /// Samples without a reflectance.
    pub fn masked(&self) -> u64 {
        self.dead + self.saturated + self.clipped
    }
}

/// One camera, ready for its frames: dark and gain of every pixel of the active area's whole cells, row-major.
#[derive(Clone, Debug)]
pub struct Calibration {
    mosaic: Mosaic,
    darks: Vec<f32>,
    /// `rho_white t_white / (white - dark)` in ns per count; 0 = dead.
    gains: Vec<f32>,
    valid_bands: u32,
}

impl Calibration {
    /// Prepares the gains. Both references must be of `mosaic`'s size and hold frames.
    pub fn new(
        mosaic: &Mosaic,
        dark: &Reference,
        white: &Reference,
        target: WhiteTarget,
    ) -> Result<Self, SpectralError> {
        if target.exposure_nanos == 0 {
            return Err(SpectralError::Exposure { what: "white", nanos: 0 });
        }
        if !(target.reflectance > 0.0 && target.reflectance <= 1.0) {
            return Err(SpectralError::WhiteReflectance(target.reflectance));
        }
        check_length("dark", dark.mosaic().n_samples(), mosaic.n_samples())?;
        check_length("white", white.mosaic().n_samples(), mosaic.n_samples())?;
        let full_scale = (target.reflectance * target.exposure_nanos as f64) as f32;
        let pixels: Vec<(f32, f32)> = dark
            .means()?
            .zip(white.means()?)
            .map(|(dark, white)| match (dark, white) {
                (Some(dark), Some(white)) if white - dark >= MIN_SIGNAL => (dark, full_scale / (white - dark)),
                _ => (0.0, 0.0),
            })
            .collect();
        let area: Vec<(f32, f32)> =
            (0..mosaic.area()[1]).flat_map(|row| mosaic.area_row(&pixels, row)).copied().collect();
        let (darks, gains) = area.into_iter().unzip();
        let mut calibration = Self { mosaic: mosaic.clone(), darks, gains, valid_bands: 0 };
        calibration.valid_bands = calibration.live_bands();
        Ok(calibration)
    }

    /// The camera.
    pub fn mosaic(&self) -> &Mosaic {
        &self.mosaic
    }

    /// Bit b: band b has at least one pixel that is not dead.
    pub fn valid_bands(&self) -> u32 {
        self.valid_bands
    }

    fn live_bands(&self) -> u32 {
        let pattern = self.mosaic.pattern() as usize;
        let mut bands = 0;
        for (y, gains) in self.gains.chunks_exact(self.mosaic.area()[0]).enumerate() {
            for (x, gain) in gains.iter().enumerate() {
                bands |= u32::from(*gain > 0.0) << ((y % pattern) * pattern + x % pattern);
            }
        }
        bands
    }

    /// Reflectance and validity of every pixel of the active area's whole cells, not yet sorted by band.
    pub fn reflectance(
        &self,
        raw: &[u16],
        exposure_nanos: u64,
    ) -> Result<(Array2<f32>, Array2<bool>, FrameCounts), SpectralError> {
        let scale = self.scale(raw, exposure_nanos)?;
        let [width, height] = self.mosaic.area();
        let mut reflectances = Array2::zeros((height, width));
        let mut valid = Array2::from_elem((height, width), false);
        let mut counts = FrameCounts::default();
        let mut bits = vec![0; width];
        for (y, (mut values, mut valid)) in reflectances.outer_iter_mut().zip(valid.outer_iter_mut()).enumerate() {
            if let Some(values) = values.as_slice_mut() {
                self.row_into(raw, y, scale, values, &mut bits, &mut counts);
            }
            valid.iter_mut().zip(&bits).for_each(|(valid, bit)| *valid = *bit == 1);
        }
        Ok((reflectances, valid, counts))
    }

    /// One frame into a cube: `reflectances` is band-sequential (`n_bands` planes of `n_cells`, row-major), bit b of a
    /// cell's mask says that its band b was measured. Both are overwritten; values that were not measured are 0.
    pub fn cube_into(
        &self,
        raw: &[u16],
        exposure_nanos: u64,
        reflectances: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        let scale = self.scale(raw, exposure_nanos)?;
        let n_cells = self.mosaic.n_cells();
        let n_bands = self.mosaic.n_bands();
        check_length("cube", reflectances.len(), n_bands * n_cells)?;
        check_length("mask", masks.len(), n_cells)?;
        masks.fill(0);

        let pattern = self.mosaic.pattern() as usize;
        let columns = self.mosaic.cells()[0] as usize;
        let mut planes = ArrayViewMut2::from_shape((n_bands, n_cells), reflectances)
            .map_err(|_| SpectralError::Length { what: "cube", got: 0, expected: n_bands * n_cells })?;
        let mut counts = FrameCounts::default();
        // One raw row fits the fastest cache: calibrate it in one sweep, then deal its values out to the bands.
        let mut values = vec![0.0; self.mosaic.area()[0]];
        let mut bits = vec![0; self.mosaic.area()[0]];
        for y in 0..self.mosaic.area()[1] {
            self.row_into(raw, y, scale, &mut values, &mut bits, &mut counts);
            let cells = (y / pattern) * columns..(y / pattern + 1) * columns;
            let masks = &mut masks[cells.clone()];
            for dx in 0..pattern {
                let band = (y % pattern) * pattern + dx;
                let mut plane = planes.row_mut(band);
                let Some(plane) = plane.as_slice_mut() else { continue };
                let dealt = values[dx..].iter().step_by(pattern).zip(bits[dx..].iter().step_by(pattern));
                for ((out, mask), (value, bit)) in plane[cells.clone()].iter_mut().zip(&mut *masks).zip(dealt) {
                    *out = *value;
                    *mask |= bit << band;
                }
            }
        }
        Ok(counts)
    }

    /// Checks the frame; the inverse of its exposure time, 1/ns.
    fn scale(&self, raw: &[u16], exposure_nanos: u64) -> Result<f32, SpectralError> {
        self.mosaic.check_frame("raw", raw)?;
        if exposure_nanos == 0 {
            return Err(SpectralError::Exposure { what: "raw", nanos: 0 });
        }
        Ok((1.0 / exposure_nanos as f64) as f32)
    }

    /// Reflectance of row `y` of the area, and 1 per valid sample.
    fn row_into(
        &self,
        raw: &[u16],
        y: usize,
        scale: f32,
        values: &mut [f32],
        bits: &mut [u32],
        counts: &mut FrameCounts,
    ) {
        let width = self.mosaic.area()[0];
        let saturation = self.mosaic.saturation();
        let samples = self.mosaic.area_row(raw, y);
        let darks = &self.darks[y * width..][..width];
        let gains = &self.gains[y * width..][..width];
        let (mut n_dead, mut n_saturated, mut n_clipped) = (0_u32, 0_u32, 0_u32);
        let pixels = samples.iter().zip(darks.iter().zip(gains));
        for ((value, bit), (sample, (dark, gain))) in values.iter_mut().zip(bits).zip(pixels) {
            // Numbers, not conditions: without branches the compiler makes vectors of the loop (1.7 times as fast).
            let live = u32::from(*gain != 0.0);
            let saturated = live & u32::from(*sample >= saturation);
            let clipped = live & u32::from(*sample == 0) & u32::from(*dark > 0.0);
            let valid = live & !(saturated | clipped);
            *value = if valid == 1 { (f32::from(*sample) - dark) * (gain * scale) } else { 0.0 };
            *bit = valid;
            n_dead += 1 - live;
            n_saturated += saturated;
            n_clipped += clipped;
        }
        counts.dead += u64::from(n_dead);
        counts.saturated += u64::from(n_saturated);
        counts.clipped += u64::from(n_clipped);
    }
}
