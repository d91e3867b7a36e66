//! A 3x3 median of every band, against noise that the spectral correction has amplified.

use crate::SpectralError;
use crate::mosaic::check_length;

/// Replaces each valid value of a band-sequential cube by the median of the valid ones in the 3x3 cells around it (fewer at
/// the rims; of an even number the mean of the middle two). `size` = columns, rows of cells. Masks do not change.
pub fn median_3x3(size: [u32; 2], cube: &mut [f32], masks: &[u32]) -> Result<(), SpectralError> {
    let [columns, rows] = size.map(|side| side as usize);
    let n_cells = columns * rows;
    check_length("mask", masks.len(), n_cells)?;
    check_length("cube", cube.len(), cube.len() / n_cells.max(1) * n_cells)?;
    let mut before = Vec::with_capacity(n_cells);
    for (band, plane) in cube.chunks_exact_mut(n_cells.max(1)).enumerate() {
        before.clear();
        before.extend_from_slice(plane);
        for y in 0..rows {
            for x in 0..columns {
                let cell = y * columns + x;
                if masks[cell] >> band & 1 == 0 {
                    continue;
                }
                let (mut around, mut n) = ([0.0; 9], 0);
                for row in y.saturating_sub(1)..(y + 2).min(rows) {
                    for column in x.saturating_sub(1)..(x + 2).min(columns) {
                        let near = row * columns + column;
                        if masks[near] >> band & 1 == 1 {
                            around[n] = before[near];
                            n += 1;
                        }
                    }
                }
                let around = &mut around[..n];
                around.sort_unstable_by(f32::total_cmp);
                plane[cell] = 0.5 * (around[(n - 1) / 2] + around[n / 2]);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_goes_an_edge_stays_and_invalid_values_do_not_count() {
        let row = |outlier: f32| [0.1, outlier, 0.1, 0.9, 0.9];
        let plane = [row(0.1), row(5.0), row(0.1)].concat();
        let mut cube = [plane.clone(), plane].concat();
        let mut masks = [0b11; 15];
        masks[6] = 0b01;
        cube[15 + 6] = 0.0;
        median_3x3([5, 3], &mut cube, &masks).expect("fits");
        assert_eq!(cube[5..10], [0.1, 0.1, 0.1, 0.9, 0.9]);
        assert_eq!(cube[20..25], [0.1, 0.0, 0.1, 0.9, 0.9]);
        assert!(median_3x3([5, 3], &mut cube[..16], &masks).is_err());
    }
}
