//! Conversion of raw frames to reflectance (thesis 2.5.1):
//!
//! `R = rho_white (raw - dark) / (white - dark) * t_white / t_raw`, per pixel of the raw mosaic.
//!
//! The dark signal is bias plus dark current. Dark frames of at least two exposure times determine both (a line for each
//! pixel), and dark(t) is evaluated at the exposure time of the frame. Dark frames of one exposure time are subtracted
//! unchanged: at a few ms they contain the bias of the read-out, which does not grow with time. R is linear in the light
//! and not clamped: 1 is a perfect diffuser, and a mirror has larger values. Noise around black gives small negative
//! values; clamping them would bias every mean.
//!
//! An invalid sample is masked and its reflectance is 0, never NaN:
//! - dead: `white - dark` is below one count, or one of the references is saturated there;
//! - saturated: the largest value of the sample depth;
//! - clipped: 0 where the dark reference is above 0, so that the light is unknown.

mod pixels;
mod row;

use pixels::Pixels;
pub use pixels::WhitePanel;

use crate::mosaic::check_length;
use crate::planes::Planes;
use crate::{Correction, Mosaic, Reference, SpectralError};
use ndarray::Array2;
use row::Row;

/// A white reference with one reflectance that fills the image; see [`WhitePanel`] for other references.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteTarget {
    /// Reflectance of the target, above 0 and at most 1; 0.98 for the usual panel.
    pub reflectance: f64,
    /// Exposure time of the white frames, ns.
    pub exposure_nanos: u64,
}

/// Numbers of invalid samples in one frame. Each sample is counted under the first reason that applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Samples without valid references.
    pub dead: u64,
    /// Samples at the largest value.
    pub saturated: u64,
    /// Samples at zero, below the dark reference.
    pub clipped: u64,
}

impl FrameCounts {
    /// Samples without a reflectance.
    pub fn masked(&self) -> u64 {
        self.dead + self.saturated + self.clipped
    }

    fn add(&mut self, other: Self) {
        self.dead += other.dead;
        self.saturated += other.saturated;
        self.clipped += other.clipped;
    }
}

/// Reflectances and validity of one raw row, and the counts of all rows so far.
struct Scratch {
    darks: Vec<f32>,
    values: Vec<f32>,
    bits: Vec<u32>,
    counts: FrameCounts,
}

impl Scratch {
    fn new(width: usize) -> Self {
        Self { darks: Vec::new(), values: vec![0.0; width], bits: vec![0; width], counts: FrameCounts::default() }
    }
}

/// Exposure time of a frame, ns, and its inverse.
#[derive(Clone, Copy)]
struct Exposure {
    nanos: f32,
    inverse: f32,
}

/// Calibration of one camera: dark signal and gain of every pixel in the complete cells of the active area, row-major.
#[derive(Clone, Debug)]
pub struct Calibration {
    mosaic: Mosaic,
    /// Dark signal at exposure time 0.
    darks: Vec<f32>,
    /// Dark current, counts per ns; empty if no pixel has a dark current.
    dark_rates: Vec<f32>,
    /// `rho_white t_white / (white - dark)` in ns per count; 0 = dead.
    gains: Vec<f32>,
    valid_bands: u32,
}

/// Dark frames.
#[derive(Clone, Copy, Debug)]
pub struct DarkReference<'a> {
    /// Exposure time.
    pub exposure_nanos: u64,
    /// Mean of the frames.
    pub frames: &'a Reference,
}

/// Reflectances of a frame by row and column.
#[derive(Clone, Debug)]
pub struct PixelReflectances {
    /// The reflectances.
    pub values: Array2<f32>,
    /// Whether each one is valid.
    pub valid: Array2<bool>,
    /// Counts of invalid samples.
    pub counts: FrameCounts,
}

impl Calibration {
    /// Computes the gains. Both references must have the size of `mosaic` and at least one frame.
    pub fn new(
        mosaic: &Mosaic,
        dark: &Reference,
        white: &Reference,
        target: WhiteTarget,
    ) -> Result<Self, SpectralError> {
        let panel =
            WhitePanel { exposure_nanos: target.exposure_nanos, reflectances: vec![target.reflectance], region: None };
        let dark = DarkReference { exposure_nanos: target.exposure_nanos, frames: dark };
        Self::with_panel(mosaic, &[dark], white, &panel)
    }

    /// Like [`Self::new`], with dark frames of several exposure times and any white panel.
    pub fn with_panel(
        mosaic: &Mosaic,
        darks: &[DarkReference<'_>],
        white: &Reference,
        panel: &WhitePanel,
    ) -> Result<Self, SpectralError> {
        let pixels = Pixels::new(mosaic, darks, white, panel)?;
        let [x0, y0] = mosaic.origin().map(|first| first as usize);
        let [width, height] = mosaic.area();
        let n = width * height;
        let mut darks = Vec::with_capacity(n);
        let mut gains = Vec::with_capacity(n);
        let mut dark_rates = Vec::with_capacity(if pixels.dark_grows() { n } else { 0 });
        for y in y0..y0 + height {
            for pixel in (x0..x0 + width).map(|x| pixels.at(x, y)) {
                darks.push(pixel.bias);
                gains.push(pixel.gain);
                if pixels.dark_grows() {
                    dark_rates.push(pixel.dark_rate);
                }
            }
        }
        if dark_rates.iter().all(|rate| *rate == 0.0) {
            dark_rates = Vec::new();
        }
        let mut calibration = Self { mosaic: mosaic.clone(), darks, dark_rates, gains, valid_bands: 0 };
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

    /// Reflectances of every pixel in the complete cells of the active area, not yet sorted by band.
    pub fn reflectance(&self, raw: &[u16], exposure_nanos: u64) -> Result<PixelReflectances, SpectralError> {
        let exposure = self.exposure(raw, exposure_nanos)?;
        let [width, height] = self.mosaic.area();
        let mut reflectances = Array2::zeros((height, width));
        let mut valid = Array2::from_elem((height, width), false);
        let mut counts = FrameCounts::default();
        let mut darks = Vec::new();
        let mut bits = vec![0; width];
        for (y, (mut values, mut valid)) in reflectances.outer_iter_mut().zip(valid.outer_iter_mut()).enumerate() {
            let row = self.row(raw, y, exposure, &mut darks);
            if let Some(values) = values.as_slice_mut() {
                counts.add(row.reflectances_into(values));
                row.validity_into(&mut bits);
            }
            valid.iter_mut().zip(&bits).for_each(|(valid, bit)| *valid = *bit == 1);
        }
        Ok(PixelReflectances { values: reflectances, valid, counts })
    }

    /// Converts one frame into a cube: `reflectances` is band-sequential (`n_bands` planes of `n_cells`, row-major), bit
    /// b of a cell's mask is 1 if its band b is valid. Both are overwritten; invalid values are 0.
    pub fn cube_into(
        &self,
        raw: &[u16],
        exposure_nanos: u64,
        reflectances: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        let exposure = self.exposure(raw, exposure_nanos)?;
        let n_cells = self.mosaic.n_cells();
        let n_bands = self.mosaic.n_bands();
        check_length("cube", reflectances.len(), n_bands * n_cells)?;
        check_length("mask", masks.len(), n_cells)?;
        let columns = self.mosaic.cells()[0] as usize;
        let mut scratch = Scratch::new(self.mosaic.area()[0]);
        for (row, masks) in masks.chunks_exact_mut(columns).enumerate() {
            let mut planes = Planes { values: reflectances, stride: n_cells, start: row * columns };
            wide_loops::run(
                #[inline(always)]
                || self.cells_into(raw, row, exposure, &mut scratch, &mut planes, masks),
            );
        }
        Ok(scratch.counts)
    }

    /// Like [`Calibration::cube_into`], with each row of cells corrected while it is in the cache: `values` has a plane
    /// for each virtual band, and the masks refer to the virtual bands.
    pub fn corrected_cube_into(
        &self,
        raw: &[u16],
        exposure_nanos: u64,
        correction: &Correction,
        values: &mut [f32],
        masks: &mut [u32],
    ) -> Result<FrameCounts, SpectralError> {
        let exposure = self.exposure(raw, exposure_nanos)?;
        let n_cells = self.mosaic.n_cells();
        let n_bands = self.mosaic.n_bands();
        check_length("correction", correction.n_bands(), n_bands)?;
        check_length("corrected cube", values.len(), correction.n_virtual_bands() * n_cells)?;
        check_length("mask", masks.len(), n_cells)?;
        let columns = self.mosaic.cells()[0] as usize;
        let mut scratch = Scratch::new(self.mosaic.area()[0]);
        let mut bands = vec![0.0; n_bands * columns];
        let mut measured = vec![0; columns];
        for (row, masks) in masks.chunks_exact_mut(columns).enumerate() {
            let mut planes = Planes { values: &mut bands, stride: columns, start: 0 };
            wide_loops::run(
                #[inline(always)]
                || self.cells_into(raw, row, exposure, &mut scratch, &mut planes, &mut measured),
            );
            let mut planes = Planes { values, stride: n_cells, start: row * columns };
            correction.cells_into(&bands, &measured, &mut planes, masks);
        }
        Ok(scratch.counts)
    }

    /// Converts one row of cells: `planes` and `masks` are overwritten there.
    #[inline(always)]
    fn cells_into(
        &self,
        raw: &[u16],
        row: usize,
        exposure: Exposure,
        scratch: &mut Scratch,
        planes: &mut Planes<'_>,
        masks: &mut [u32],
    ) {
        match self.mosaic.pattern() {
            1 => self.cells_of::<1>(raw, row, exposure, scratch, planes, masks),
            2 => self.cells_of::<2>(raw, row, exposure, scratch, planes, masks),
            3 => self.cells_of::<3>(raw, row, exposure, scratch, planes, masks),
            4 => self.cells_of::<4>(raw, row, exposure, scratch, planes, masks),
            _ => self.cells_of::<5>(raw, row, exposure, scratch, planes, masks),
        }
    }

    /// Implementation of [`Self::cells_into`] for a pattern of `P` px.
    #[inline(always)]
    fn cells_of<const P: usize>(
        &self,
        raw: &[u16],
        row: usize,
        exposure: Exposure,
        Scratch { darks, values, bits, counts }: &mut Scratch,
        planes: &mut Planes<'_>,
        masks: &mut [u32],
    ) {
        masks.fill(0);
        // One raw row fits the L1 cache: calibrate it in one pass, then distribute its values to the bands.
        for dy in 0..P {
            let samples = self.row(raw, row * P + dy, exposure, darks);
            let found = samples.reflectances_into(values);
            row::distribute::<P>(values, dy, planes);
            if found.masked() == 0 {
                let all = ((1 << P) - 1) << (dy * P);
                for mask in &mut *masks {
                    *mask |= all;
                }
            } else {
                samples.validity_into(bits);
                row::distribute_validity::<P>(bits, dy, masks);
                counts.add(found);
            }
        }
    }

    /// Checks the frame and its exposure time.
    fn exposure(&self, raw: &[u16], nanos: u64) -> Result<Exposure, SpectralError> {
        self.mosaic.check_frame("raw", raw)?;
        if nanos == 0 {
            return Err(SpectralError::Exposure { what: "raw", nanos });
        }
        Ok(Exposure { nanos: nanos as f32, inverse: (1.0 / nanos as f64) as f32 })
    }

    /// Row `y` of the area. `darks` is a buffer.
    #[inline(always)]
    fn row<'a>(&'a self, raw: &'a [u16], y: usize, exposure: Exposure, darks: &'a mut Vec<f32>) -> Row<'a> {
        let width = self.mosaic.area()[0];
        let of_row = y * width..(y + 1) * width;
        let biases = &self.darks[of_row.clone()];
        let darks = match self.dark_rates.get(of_row.clone()) {
            Some(rates) => {
                darks.clear();
                darks.extend(biases.iter().zip(rates).map(|(bias, rate)| bias + rate * exposure.nanos));
                &darks[..]
            }
            None => biases,
        };
        Row {
            samples: self.mosaic.area_row(raw, y),
            darks,
            gains: &self.gains[of_row],
            scale: exposure.inverse,
            saturation: self.mosaic.saturation(),
        }
    }
}
