//! Spectral correction: converts the bands of the filters to virtual bands with one peak each.
//!
//! The filters of a mosaic camera have second-order peaks and crosstalk. The manufacturer delivers a matrix C. Its row j
//! combines the reflectances of all P x P filters to the reflectance of virtual band j: `r_j = sum_k C_jk r_k` (k in the
//! order of the pattern). Rows sum to 1, so a white reference stays flat.
//!
//! A virtual band is valid if all bands with a weight in its row are valid. Invalid values are 0.

use crate::SpectralError;
use crate::limits::MAX_PATTERN;
use crate::mosaic::check_length;
use crate::planes::Planes;

/// Cells per block: its bands stay in the L1 cache.
const BLOCK: usize = 64;
/// Number of rows whose sums are in registers together. 5 rows x 16 cells are ten of the sixteen AVX2 registers, and each
/// loaded value is used for five rows. Five divides the row counts of the usual matrices, 15 and 25. Because of this
/// register blocking, the product is not a matrix product of `ndarray`.
const ROWS: usize = 5;
/// Number of cells whose sums are in registers together; see [`ROWS`].
const LANES: usize = 16;
/// Largest number of bands: a mask has a bit for each band.
const MAX_BANDS: usize = (MAX_PATTERN * MAX_PATTERN) as usize;

/// One correction matrix, ready for cubes.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    n_bands: usize,
    /// Mask of each row: bit k is set if band k has a weight.
    needs: Vec<u32>,
    /// Groups of [`ROWS`] rows, band by band; missing rows are zero.
    groups: Vec<Vec<[f32; ROWS]>>,
}

impl Correction {
    /// Takes `rows`: for each virtual band, the finite coefficients of all `n_bands` bands. Both numbers are 1 to 25.
    pub fn new<'a>(n_bands: usize, rows: impl IntoIterator<Item = &'a [f64]>) -> Result<Self, SpectralError> {
        let is_size = |n: usize| (1..=MAX_BANDS).contains(&n);
        if !is_size(n_bands) {
            return Err(SpectralError::CorrectionSize { what: "bands", n: n_bands });
        }
        let mut needs = Vec::new();
        let mut groups = Vec::new();
        for (j, coefficients) in rows.into_iter().enumerate() {
            check_length("row of the correction", coefficients.len(), n_bands)?;
            if let Some(value) = coefficients.iter().find(|value| !value.is_finite()) {
                return Err(SpectralError::Coefficient { row: j, value: *value });
            }
            let weighed = coefficients.iter().enumerate().filter(|(_, value)| **value != 0.0);
            needs.push(weighed.fold(0, |bits, (band, _)| bits | 1 << band));
            groups.resize(j / ROWS + 1, vec![[0.0; ROWS]; n_bands]);
            for (slot, value) in groups[j / ROWS].iter_mut().zip(coefficients) {
                slot[j % ROWS] = *value as f32;
            }
        }
        if !is_size(needs.len()) {
            return Err(SpectralError::CorrectionSize { what: "virtual bands", n: needs.len() });
        }
        Ok(Self { n_bands, needs, groups })
    }

    /// Number of bands of the filters.
    pub fn n_bands(&self) -> usize {
        self.n_bands
    }

    /// Number of virtual bands.
    pub fn n_virtual_bands(&self) -> usize {
        self.needs.len()
    }

    /// Mask of the virtual bands that are valid if the bands in `mask` are: for one cell, or for a whole camera.
    pub fn valid(&self, mask: u32) -> u32 {
        let valid = |(j, needs): (usize, &u32)| u32::from(mask & needs == *needs) << j;
        self.needs.iter().enumerate().map(valid).fold(0, |bits, bit| bits | bit)
    }

    /// Corrects a cube. `bands` and `virtual_bands` are band-sequential with one value per cell; bit k of a cell's mask
    /// is set if its band k was measured. `virtual_bands` and `virtual_masks` are overwritten.
    pub fn correct_into(
        &self,
        bands: &[f32],
        masks: &[u32],
        virtual_bands: &mut [f32],
        virtual_masks: &mut [u32],
    ) -> Result<(), SpectralError> {
        let n_cells = masks.len();
        check_length("cube", bands.len(), self.n_bands * n_cells)?;
        check_length("corrected cube", virtual_bands.len(), self.needs.len() * n_cells)?;
        check_length("corrected mask", virtual_masks.len(), n_cells)?;
        let mut planes = Planes { values: virtual_bands, stride: n_cells, start: 0 };
        self.cells_into(bands, masks, &mut planes, virtual_masks);
        Ok(())
    }

    /// Corrects some cells of a cube; `bands` and `masks` contain only these cells, and their lengths match.
    pub(crate) fn cells_into(&self, bands: &[f32], masks: &[u32], planes: &mut Planes<'_>, virtual_masks: &mut [u32]) {
        let n_cells = masks.len();
        let all = u32::MAX >> (32 - self.n_bands);
        let all_valid = self.valid(all);
        let mut block = [[0.0; BLOCK]; MAX_BANDS];
        let mut sums = [[0.0; BLOCK]; ROWS];
        for start in (0..n_cells).step_by(BLOCK) {
            let n = BLOCK.min(n_cells - start);
            let cells = start..start + n;
            for (band, lanes) in block.iter_mut().enumerate().take(self.n_bands) {
                lanes[..n].copy_from_slice(&bands[band * n_cells..][cells.clone()]);
            }
            for (out, mask) in virtual_masks[cells.clone()].iter_mut().zip(&masks[cells.clone()]) {
                *out = if mask & all == all { all_valid } else { self.valid(*mask) };
            }
            let masks = &virtual_masks[cells.clone()];
            let is_whole = masks.iter().all(|mask| *mask == all_valid);
            for (group, first) in self.groups.iter().zip((0..).step_by(ROWS)) {
                wide_loops::run(
                    #[inline(always)]
                    || combine_into(group, &block, &mut sums),
                );
                for (sums, j) in sums.iter_mut().zip(first..self.needs.len()) {
                    if !is_whole {
                        let valid = masks.iter().map(|mask| mask >> j & 1 == 1);
                        sums.iter_mut().zip(valid).filter(|(_, valid)| !valid).for_each(|(sum, _)| *sum = 0.0);
                    }
                    planes.values[j * planes.stride + planes.start + start..][..n].copy_from_slice(&sums[..n]);
                }
            }
        }
    }
}

/// [`ROWS`] rows of the matrix times a block of cells.
#[allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds are what the compiler unrolls into registers"
)]
#[inline(always)]
fn combine_into(group: &[[f32; ROWS]], block: &[[f32; BLOCK]; MAX_BANDS], sums: &mut [[f32; BLOCK]; ROWS]) {
    for lane in 0..BLOCK / LANES {
        let mut chunk = [[0.0; LANES]; ROWS];
        for (coefficients, values) in group.iter().zip(block) {
            let values = values.as_chunks::<LANES>().0[lane];
            let coefficients = *coefficients;
            for row in 0..ROWS {
                for k in 0..LANES {
                    chunk[row][k] += coefficients[row] * values[k];
                }
            }
        }
        for (sums, chunk) in sums.iter_mut().zip(&chunk) {
            sums.as_chunks_mut::<LANES>().0[lane] = *chunk;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More cells than a block, and not a multiple of one.
    const N_CELLS: usize = 77;

    fn matrix() -> Vec<Vec<f64>> {
        // The second row has no weight for band 2.
        vec![vec![1.5, -0.25, -0.5, 0.25], vec![0.5, 0.75, 0.0, -0.25], vec![0.0, 0.0, 0.5, 0.5]]
    }

    fn correction() -> Correction {
        Correction::new(4, matrix().iter().map(|row| &row[..])).expect("sound")
    }

    #[test]
    fn corrected_cell_is_the_product_of_matrix_and_bands() {
        let value = |band: usize, cell: usize| (band * 31 + cell * 7 % 53) as f32 / 100.0;
        let bands: Vec<f32> = (0..4).flat_map(|band| (0..N_CELLS).map(move |cell| value(band, cell))).collect();
        let mut out = vec![9.0; 3 * N_CELLS];
        let mut masks = vec![9; N_CELLS];
        correction().correct_into(&bands, &[0b1111; N_CELLS], &mut out, &mut masks).expect("fits");
        assert_eq!(masks, [0b111; N_CELLS]);
        for (j, row) in matrix().iter().enumerate() {
            for cell in 0..N_CELLS {
                let expected: f64 = row.iter().enumerate().map(|(k, c)| c * f64::from(value(k, cell))).sum();
                assert!((f64::from(out[j * N_CELLS + cell]) - expected).abs() < 1e-5, "row {j} cell {cell}");
            }
        }
    }

    #[test]
    fn invalid_band_invalidates_only_the_rows_that_use_it() {
        let mut masks = [0b1111; N_CELLS];
        (masks[40], masks[76]) = (0b1011, 0b1110);
        let mut out = vec![9.0; 3 * N_CELLS];
        let mut valid = vec![9; N_CELLS];
        correction().correct_into(&[0.5; 4 * N_CELLS], &masks, &mut out, &mut valid).expect("fits");
        assert_eq!((valid[39], valid[40], valid[76]), (0b111, 0b010, 0b100));
        let at = |cell: usize| [0, 1, 2].map(|j| out[j * N_CELLS + cell]);
        assert_eq!((at(39), at(40), at(76)), ([0.5, 0.5, 0.5], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]));
    }

    #[test]
    fn matrices_and_cubes_of_wrong_size_are_rejected() {
        assert_eq!(
            Correction::new(4, [&[1.0, 0.0][..]]),
            Err(SpectralError::Length { what: "row of the correction", got: 2, expected: 4 })
        );
        assert!(matches!(Correction::new(1, [&[f64::NAN][..]]), Err(SpectralError::Coefficient { row: 0, .. })));
        assert!(matches!(Correction::new(26, [&[0.0; 26][..]]), Err(SpectralError::CorrectionSize { n: 26, .. })));
        assert!(matches!(Correction::new(1, []), Err(SpectralError::CorrectionSize { n: 0, .. })));
        let error = correction().correct_into(&[0.0; 7], &[0; 2], &mut [0.0; 6], &mut [0; 2]);
        assert_eq!(error, Err(SpectralError::Length { what: "cube", got: 7, expected: 8 }));
    }
}
