//! A 3x3 median filter for each band, which reduces the noise amplified by the spectral correction.

use crate::SpectralError;
use crate::mosaic::check_length;

/// Replaces each valid value of a band-sequential cube by the median of the valid values in its 3x3 neighborhood (smaller
/// at the image border; for an even number of values, the mean of the middle two). `size` = columns, rows of cells. Masks
/// do not change.
pub fn median_3x3(size: [u32; 2], cube: &mut [f32], masks: &[u32]) -> Result<(), SpectralError> {
    let [columns, rows] = size.map(|side| side as usize);
    let n_cells = columns * rows;
    check_length("mask", masks.len(), n_cells)?;
    check_length("cube", cube.len(), cube.len() / n_cells.max(1) * n_cells)?;
    let n_bands = cube.len() / n_cells.max(1);
    let gaps = gaps(columns, rows, masks, u32::MAX.checked_shr(32 - n_bands.min(32) as u32).unwrap_or(0));
    let mut before = Vec::with_capacity(n_cells);
    let mut sorted = [(); 3].map(|()| vec![0.0; columns]);
    for (band, plane) in cube.chunks_exact_mut(n_cells.max(1)).enumerate() {
        before.clear();
        before.extend_from_slice(plane);
        // First all cells as if all values were valid, then cells with invalid neighbors again.
        for y in 1..rows.saturating_sub(1) {
            let three = &before[(y - 1) * columns..(y + 2) * columns];
            let out = &mut plane[y * columns..(y + 1) * columns];
            let row = Row { three, sorted: &mut sorted, out };
            wide_loops::run(
                #[inline(always)]
                || row.medians(),
            );
        }
        for (cell, lacking) in &gaps {
            if masks[*cell] >> band & 1 == 0 {
                plane[*cell] = before[*cell];
            } else if lacking >> band & 1 == 1 {
                plane[*cell] = valid_median(*cell, columns, &before, |near| masks[near] >> band & 1 == 1);
            }
        }
    }
    Ok(())
}

/// Cells with an invalid neighbor, and its bands as bits. Cells at the image border have all bits.
fn gaps(columns: usize, rows: usize, masks: &[u32], bands: u32) -> Vec<(usize, u32)> {
    let lacking = |cell: usize| {
        let x = cell % columns;
        let y = cell / columns;
        if x == 0 || y == 0 || x + 1 == columns || y + 1 == rows {
            return bands;
        }
        let around = [cell - columns, cell, cell + columns];
        bands & !around.iter().flat_map(|at| &masks[at - 1..at + 2]).fold(u32::MAX, |all, mask| all & mask)
    };
    (0..masks.len()).map(|cell| (cell, lacking(cell))).filter(|(_, lacking)| *lacking != 0).collect()
}

/// Median of the valid values around a valid cell.
fn valid_median(cell: usize, columns: usize, before: &[f32], is_valid: impl Fn(usize) -> bool) -> f32 {
    let x = cell % columns;
    let y = cell / columns;
    let mut around = [0.0; 9];
    let mut n = 0;
    for row in y.saturating_sub(1)..(y + 2).min(before.len() / columns) {
        for column in x.saturating_sub(1)..(x + 2).min(columns) {
            let near = row * columns + column;
            if is_valid(near) {
                around[n] = before[near];
                n += 1;
            }
        }
    }
    let around = &mut around[..n];
    around.sort_unstable_by(f32::total_cmp);
    0.5 * (around[(n - 1) / 2] + around[n / 2])
}

/// The medians of a row without its ends. The median of nine values is the median of three: the largest column minimum,
/// the median of the column medians, and the smallest column maximum.
struct Row<'a> {
    /// The row above, this one and the one below.
    three: &'a [f32],
    /// Smallest, middle and largest of each column.
    sorted: &'a mut [Vec<f32>; 3],
    out: &'a mut [f32],
}

impl Row<'_> {
    #[inline(always)]
    fn medians(self) {
        let Self { three, sorted: [low, middle, high], out } = self;
        let n = out.len();
        let above = &three[..n];
        let here = &three[n..2 * n];
        let below = &three[2 * n..3 * n];
        let low = &mut low[..n];
        let middle = &mut middle[..n];
        let high = &mut high[..n];
        for i in 0..n {
            let a = above[i];
            let b = here[i];
            let c = below[i];
            low[i] = min(min(a, b), c);
            middle[i] = median(a, b, c);
            high[i] = max(max(a, b), c);
        }
        if n < 3 {
            return;
        }
        let out = &mut out[1..n - 1];
        for i in 0..out.len() {
            let lows = max(max(low[i], low[i + 1]), low[i + 2]);
            let middles = median(middle[i], middle[i + 1], middle[i + 2]);
            let highs = min(min(high[i], high[i + 1]), high[i + 2]);
            out[i] = median(lows, middles, highs);
        }
    }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[inline(always)]
fn median(a: f32, b: f32, c: f32) -> f32 {
    max(min(a, b), min(max(a, b), c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_removes_outliers_keeps_edges_and_ignores_invalid_values() {
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

    #[test]
    fn fully_valid_cube_has_gaps_only_at_the_rim() {
        let looked_at = gaps(5, 4, &[0b11; 20], 0b11);
        assert_eq!(looked_at.len(), 14);
        assert!(looked_at.iter().all(|(_, lacking)| *lacking == 0b11));
    }

    #[test]
    fn fast_medians_equal_medians_by_sorting() {
        for [columns, rows] in [[1, 1], [2, 5], [5, 2], [37, 11]] {
            let n_cells = columns * rows;
            let chance = |i: usize| (((i + 1) as f32 * 12.9898).sin() * 43_758.547).rem_euclid(1.0);
            let cube: Vec<f32> = (0..2 * n_cells).map(chance).collect();
            let masks: Vec<u32> = (0..n_cells).map(|i| if chance(7 * i) < 0.1 { 0b10 } else { 0b11 }).collect();
            let mut found = cube.clone();
            median_3x3([columns as u32, rows as u32], &mut found, &masks).expect("fits");
            for (at, value) in found.iter().enumerate() {
                let band = at / n_cells;
                let cell = at % n_cells;
                let is_valid = |near: usize| masks[near] >> band & 1 == 1;
                let before = &cube[band * n_cells..(band + 1) * n_cells];
                let expected =
                    if is_valid(cell) { valid_median(cell, columns, before, is_valid) } else { before[cell] };
                assert_eq!(*value, expected, "{columns} x {rows}, band {band}, cell {cell}");
            }
        }
    }
}
