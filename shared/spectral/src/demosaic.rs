//! Demosaicing: every band at every pixel.
//!
//! | method | idea | source |
//! |---|---|---|
//! | WB | bilinear interpolation of each band between its own samples | Brauers and Aach, 2006 |
//! | ID | bilinear interpolation of the differences to a pseudo-panchromatic image (PPI, the mean of all bands); the PPI is a blurred mosaic | Mihoubi et al., 2015 |
//! | IID | like ID, with the PPI estimated again from the previous result | Mihoubi et al., 2015 |
//! | PPID | like ID, with a sharp PPI: the sample of each pixel, corrected by its band's difference to the PPI, weighted along edges | Mihoubi et al., IEEE TCI 2017 |
//!
//! All methods keep the measured samples bit by bit and reproduce a mosaic that is constant per band (WB bit by bit, the
//! others within 1e-6). At the image border each band continues as in its last pattern cell.

mod filter;
mod gaps;
mod lattice;
mod panchromatic;
mod rows;

use crate::SpectralError;
use crate::limits::MAX_PATTERN;
use crate::mosaic::check_length;
use crate::planes::Planes;
use lattice::Lattice;
use rows::{Parts, Rows};

/// Demosaicing method; see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demosaicing {
    /// WB.
    WeightedBilinear,
    /// ID.
    IntensityDifference,
    /// IID with this number of estimates of the PPI after the first. More estimates reduce the error and amplify noise; 2 is usual.
    IterativeIntensityDifference(u32),
    /// PPID.
    PpiDifference,
}

settings::words! {
    /// Resolution of cubes, with the names used in settings and commands.
    pub enum Resolution {
        /// One cell per pattern cell.
        Bin = "bin",
        /// One cell per pixel by [`Demosaicing::WeightedBilinear`].
        Wb = "wb",
        /// One cell per pixel by [`Demosaicing::IntensityDifference`].
        Id = "id",
        /// One cell per pixel by [`Demosaicing::IterativeIntensityDifference`] with two estimates.
        Iid = "iid",
        /// One cell per pixel by [`Demosaicing::PpiDifference`].
        Ppid = "ppid",
    }
}

impl Resolution {
    /// The method for one cell per pixel; `None` for one cell per pattern cell.
    pub fn demosaicing(self) -> Option<Demosaicing> {
        match self {
            Self::Bin => None,
            Self::Wb => Some(Demosaicing::WeightedBilinear),
            Self::Id => Some(Demosaicing::IntensityDifference),
            Self::Iid => Some(Demosaicing::IterativeIntensityDifference(2)),
            Self::Ppid => Some(Demosaicing::PpiDifference),
        }
    }
}

/// Demosaics images of one size and keeps its buffers.
#[derive(Debug)]
pub struct Demosaicer {
    lattice: Lattice,
    ppi: Vec<f32>,
    difference: Vec<f32>,
    scratch: Vec<f32>,
}

impl Demosaicer {
    /// A demosaicer for mosaics of `width` times `height` px that consist of whole cells of `pattern` px from the top
    /// left (4 rows of 4 bands: 4).
    pub fn new(width: usize, height: usize, pattern: usize) -> Result<Self, SpectralError> {
        if !(1..=MAX_PATTERN as usize).contains(&pattern) {
            return Err(SpectralError::Pattern(u32::try_from(pattern).unwrap_or(u32::MAX)));
        }
        let whole = |length: usize| length > 0 && length.is_multiple_of(pattern);
        if !(whole(width) && whole(height)) {
            return Err(SpectralError::PartialCells { width, height, pattern });
        }
        let lattice = Lattice { width, height, pattern };
        Ok(Self { lattice, ppi: Vec::new(), difference: Vec::new(), scratch: Vec::new() })
    }

    /// Number of bands of a mosaic.
    pub fn n_bands(&self) -> usize {
        self.lattice.n_bands()
    }

    /// Demosaics `samples`, reflectances row by row (PPID weights edges relative to a step of 1/255 of full reflectance).
    /// `bands` is overwritten: band `k = (y mod P) P + (x mod P)` after band, each of the size of the mosaic.
    pub fn demosaic_into(
        &mut self,
        samples: &[f32],
        method: Demosaicing,
        bands: &mut [f32],
    ) -> Result<(), SpectralError> {
        let width = self.lattice.width;
        let n_pixels = self.lattice.width * self.lattice.height;
        check_length("bands", bands.len(), n_pixels * self.n_bands())?;
        let mut rows = self.rows(samples, method)?;
        for start in (0..n_pixels).step_by(width) {
            rows.next_into(&mut Planes { values: bands, stride: n_pixels, start });
        }
        Ok(())
    }

    /// Like [`Demosaicer::demosaic_into`], row by row: `each` receives the bands of each row, band-sequential.
    pub fn demosaic_rows(
        &mut self,
        samples: &[f32],
        method: Demosaicing,
        mut each: impl FnMut(&[f32]),
    ) -> Result<(), SpectralError> {
        let Lattice { width, height, .. } = self.lattice;
        let mut row = vec![0.0; width * self.n_bands()];
        let mut rows = self.rows(samples, method)?;
        for _ in 0..height {
            rows.next_into(&mut Planes { values: &mut row, stride: width, start: 0 });
            each(&row);
        }
        Ok(())
    }

    /// Prepares the rows of an image.
    fn rows<'a>(&'a mut self, samples: &'a [f32], method: Demosaicing) -> Result<Rows<'a>, SpectralError> {
        check_length("mosaic", samples.len(), self.lattice.width * self.lattice.height)?;
        if method == Demosaicing::WeightedBilinear {
            let parts = Parts { lattice: &self.lattice, mosaic: samples, shared: None, measured: samples };
            return Ok(Rows::new(parts));
        }
        filter::box_into(&self.lattice, samples, &mut self.ppi, &mut self.scratch);
        match method {
            Demosaicing::WeightedBilinear | Demosaicing::IntensityDifference => {}
            Demosaicing::IterativeIntensityDifference(iterations) => {
                // The PPI is the mean of all bands; the sum of their differences is the tent-filtered difference image.
                let mut blurred = Vec::new();
                for _ in 0..iterations {
                    difference_into(samples, &self.ppi, &mut self.difference);
                    filter::tent_into(&self.lattice, &self.difference, &mut blurred, &mut self.scratch);
                    let n_bands = self.n_bands() as f32;
                    self.ppi.iter_mut().zip(&blurred).for_each(|(ppi, sum)| *ppi += sum / n_bands);
                }
            }
            Demosaicing::PpiDifference => {
                difference_into(&self.ppi, samples, &mut self.difference);
                panchromatic::sharpen(&self.lattice, samples, &self.difference, &mut self.ppi);
            }
        }
        difference_into(samples, &self.ppi, &mut self.difference);
        let mosaic = &self.difference[..];
        let shared = Some(&self.ppi[..]);
        Ok(Rows::new(Parts { lattice: &self.lattice, mosaic, shared, measured: samples }))
    }

    /// Replaces samples that are not `valid` by an estimate from the nearest samples of their band, so that filters do
    /// not treat them as black. [`Demosaicer::masks_into`] still marks the values that depend on them as invalid.
    pub fn bridge_gaps(&self, samples: &mut [f32], valid: &[bool]) -> Result<(), SpectralError> {
        let n_pixels = self.lattice.width * self.lattice.height;
        check_length("mosaic", samples.len(), n_pixels)?;
        check_length("mask", valid.len(), n_pixels)?;
        gaps::bridge(&self.lattice, samples, valid);
        Ok(())
    }

    /// Validity of the bands: bit k of a pixel's mask is 1 if all samples used to interpolate band k are `valid`. The
    /// blur of the PPI is ignored. `masks` is overwritten.
    pub fn masks_into(&self, valid: &[bool], masks: &mut [u32]) -> Result<(), SpectralError> {
        let n_pixels = self.lattice.width * self.lattice.height;
        check_length("mask", valid.len(), n_pixels)?;
        check_length("masks of bands", masks.len(), n_pixels)?;
        gaps::masks_into(&self.lattice, valid, masks);
        Ok(())
    }
}

fn difference_into(a: &[f32], b: &[f32], out: &mut Vec<f32>) {
    out.clear();
    out.extend(a.iter().zip(b).map(|(a, b)| a - b));
}
