//! Full resolution from a mosaic: every band at every pixel.
//!
//! | method | idea | source |
//! |---|---|---|
//! | WB | each band alone, bilinear between its own samples | Brauers and Aach, 2006 |
//! | ID | the differences to a pseudo-panchromatic image (PPI, the mean of all bands) are bilinear; the PPI is a blur of the mosaic | Mihoubi et al., 2015 |
//! | IID | the same, the PPI being estimated anew from the last result | Mihoubi et al., 2015 |
//! | PPID | the same, the PPI being sharp: at each pixel its own sample, corrected by its band's difference to the PPI along edges rather than across them | Mihoubi et al., IEEE TCI 2017 |
//!
//! All keep what was measured, to the bit, and give a mosaic that is constant per band back (WB to the bit, the others within
//! one in a million). At the rims each band goes on as in its last pattern cell.

mod filter;
mod lattice;
mod panchromatic;

use crate::SpectralError;
use crate::mosaic::{MAX_PATTERN, check_length};
use lattice::Lattice;

/// How bands are brought to full resolution; see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demosaicing {
    /// WB.
    WeightedBilinear,
    /// ID.
    IntensityDifference,
    /// IID with this many estimates of the PPI after the first. More gives smaller errors and less smooth noise; 2 is usual.
    IterativeIntensityDifference(u32),
    /// PPID.
    PpiDifference,
}

/// Demosaics images of one size; holds the memory for it.
#[derive(Debug)]
pub struct Demosaicer {
    lattice: Lattice,
    ppi: Vec<f32>,
    difference: Vec<f32>,
    scratch: Vec<f32>,
}

impl Demosaicer {
    /// For mosaics of `width` times `height` px, whole cells of `pattern` px from the top left (4 rows of 4 bands: 4).
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

    /// Bands of a mosaic.
    pub fn n_bands(&self) -> usize {
        self.lattice.pattern * self.lattice.pattern
    }

    /// `samples`: row by row, reflectances (PPID weighs edges against a step of 1/255 of full reflectance). `bands` is
    /// overwritten: band `k = (y mod P) P + (x mod P)` after band, each of the mosaic's size.
    pub fn demosaic_into(
        &mut self,
        samples: &[f32],
        method: Demosaicing,
        bands: &mut [f32],
    ) -> Result<(), SpectralError> {
        let n_pixels = self.lattice.width * self.lattice.height;
        check_length("mosaic", samples.len(), n_pixels)?;
        check_length("bands", bands.len(), n_pixels * self.n_bands())?;
        if method == Demosaicing::WeightedBilinear {
            self.lattice.interpolate_into(samples, bands);
            return Ok(());
        }
        filter::box_into(&self.lattice, samples, &mut self.ppi, &mut self.scratch);
        match method {
            Demosaicing::WeightedBilinear | Demosaicing::IntensityDifference => {}
            Demosaicing::IterativeIntensityDifference(iterations) => {
                // The mean of all bands' estimates: the sum of their differences is the bilinear blur of the differences.
                for _ in 0..iterations {
                    difference_into(samples, &self.ppi, &mut self.difference);
                    let blurred = &mut Vec::new();
                    filter::tent_into(&self.lattice, &self.difference, blurred, &mut self.scratch);
                    let n_bands = self.n_bands() as f32;
                    self.ppi.iter_mut().zip(&*blurred).for_each(|(ppi, sum)| *ppi += sum / n_bands);
                }
            }
            Demosaicing::PpiDifference => {
                difference_into(&self.ppi, samples, &mut self.difference);
                panchromatic::sharpen(&self.lattice, samples, &self.difference, &mut self.ppi);
            }
        }
        difference_into(samples, &self.ppi, &mut self.difference);
        self.lattice.interpolate_into(&self.difference, bands);
        for (band, plane) in bands.chunks_exact_mut(n_pixels).enumerate() {
            plane.iter_mut().zip(&self.ppi).for_each(|(value, ppi)| *value += ppi);
            self.lattice.keep_measured(samples, band, plane);
        }
        Ok(())
    }

    /// Which bands are known where: `bands`, as [`Demosaicer::demosaic_into`] gives them, is 1 where all samples between which
    /// the band is interpolated are valid (1 in `valid`, else 0). The PPI's blur is left out of account.
    pub fn validity_into(&self, valid: &[f32], bands: &mut [f32]) -> Result<(), SpectralError> {
        let n_pixels = self.lattice.width * self.lattice.height;
        check_length("mask", valid.len(), n_pixels)?;
        check_length("masks of bands", bands.len(), n_pixels * self.n_bands())?;
        self.lattice.interpolate_into(valid, bands);
        // Weights are multiples of 1/25 at least: anything below 1 had an invalid sample.
        for share in bands {
            *share = f32::from(u8::from(*share > 0.999));
        }
        Ok(())
    }
}

fn difference_into(a: &[f32], b: &[f32], out: &mut Vec<f32>) {
    out.clear();
    out.extend(a.iter().zip(b).map(|(a, b)| a - b));
}
