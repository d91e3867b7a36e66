//! Calibrates one row of samples and distributes it to the bands of a row of cells.

use super::FrameCounts;
use crate::planes::Planes;

/// The samples of a row with the calibration of their pixels, all of one length.
pub struct Row<'a> {
    pub samples: &'a [u16],
    pub darks: &'a [f32],
    /// Gain per count and ns; 0 = dead.
    pub gains: &'a [f32],
    /// The inverse of the exposure time, 1/ns.
    pub scale: f32,
    pub saturation: u16,
}

impl Row<'_> {
    /// Reflectances (0 for invalid samples) and the counts of invalid samples.
    // Numbers instead of conditions: branch-free loops vectorize.
    #[inline(always)]
    pub fn reflectances_into(&self, values: &mut [f32]) -> FrameCounts {
        let mut n_dead = 0_u32;
        let mut n_saturated = 0_u32;
        let mut n_clipped = 0_u32;
        let pixels = self.samples.iter().zip(self.darks.iter().zip(self.gains));
        for (value, (sample, (dark, gain))) in values.iter_mut().zip(pixels) {
            let [dead, saturated, clipped] = self.faults(*sample, *dark, *gain);
            let reflectance = (f32::from(*sample) - dark) * (gain * self.scale);
            *value = if dead | saturated | clipped == 0 { reflectance } else { 0.0 };
            n_dead += dead;
            n_saturated += saturated;
            n_clipped += clipped;
        }
        let [dead, saturated, clipped] = [n_dead, n_saturated, n_clipped].map(u64::from);
        FrameCounts { dead, saturated, clipped }
    }

    /// 1 for each valid sample, else 0.
    #[inline(always)]
    pub fn validity_into(&self, bits: &mut [u32]) {
        let pixels = self.samples.iter().zip(self.darks.iter().zip(self.gains));
        for (bit, (sample, (dark, gain))) in bits.iter_mut().zip(pixels) {
            let [dead, saturated, clipped] = self.faults(*sample, *dark, *gain);
            *bit = 1 - (dead | saturated | clipped);
        }
    }

    /// Flags for dead, saturated, clipped; at most one of them is 1.
    #[inline(always)]
    fn faults(&self, sample: u16, dark: f32, gain: f32) -> [u32; 3] {
        let live = u32::from(gain != 0.0);
        let saturated = live & u32::from(sample >= self.saturation);
        let clipped = live & u32::from(sample == 0) & u32::from(dark > 0.0);
        [1 - live, saturated, clipped & !saturated]
    }
}

/// Distributes the values of raw row `dy` of a row of cells to the planes of the bands; `P` is the side of the pattern.
#[inline(always)]
pub fn distribute<const P: usize>(values: &[f32], dy: usize, planes: &mut Planes<'_>) {
    let cells = values.as_chunks::<P>().0;
    for dx in 0..P {
        let plane = &mut planes.values[(dy * P + dx) * planes.stride + planes.start..][..cells.len()];
        plane.iter_mut().zip(cells).for_each(|(out, cell)| *out = cell[dx]);
    }
}

/// Sets the bits of the bands in raw row `dy` in the masks of a row of cells, where their samples are valid.
#[inline(always)]
pub fn distribute_validity<const P: usize>(bits: &[u32], dy: usize, masks: &mut [u32]) {
    for (mask, cell) in masks.iter_mut().zip(bits.as_chunks::<P>().0) {
        let row = cell.iter().enumerate().fold(0, |row, (dx, bit)| row | bit << dx);
        *mask |= row << (dy * P);
    }
}
