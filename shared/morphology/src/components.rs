//! Connected components of a binary image.

use crate::blocks::{block, block_mut, in_blocks};
use crate::labels::Labels;
use crate::neighbors::Connectivity;
use crate::runs::{Builder, RowBits, Runs, shift_right_by_one_pixel, write_words};
use ndarray::Array2;

/// Connected components of the pixels that are `true`.
pub fn connected_components(mask: &Array2<bool>, connectivity: Connectivity) -> Labels {
    labels_of(&runs_of(mask, connectivity), mask)
}

/// Runs of pixels that are `true`, with the labels of their components.
pub(crate) fn runs_of(mask: &Array2<bool>, connectivity: Connectivity) -> Runs {
    let mask = mask.as_standard_layout();
    let mut builder = Builder::new(mask.ncols());
    let mut above = RowBits::new(mask.ncols());
    let mut row = RowBits::new(mask.ncols());
    for pixels in mask.rows() {
        let pixels = pixels.to_slice().expect("rows of the standard layout are contiguous");
        wide_loops::run(
            #[inline(always)]
            || {
                write_words(pixels, &mut row.inside);
                let mut left = 0;
                let mut left_above = 0;
                for (idx, (&here, &up)) in row.inside.iter().zip(&above.inside).enumerate() {
                    row.begins[idx] = here & !shift_right_by_one_pixel(here, left);
                    row.up[idx] = here & up;
                    row.up_left[idx] = here & shift_right_by_one_pixel(up, left_above);
                    row.left_up[idx] = shift_right_by_one_pixel(here, left) & up;
                    left = here;
                    left_above = up;
                }
                builder.add_row(&row, connectivity);
            },
        );
        std::mem::swap(&mut row, &mut above);
    }
    builder.finish()
}

/// Label image of runs. `inside` are the pixels of the runs.
pub(crate) fn labels_of(runs: &Runs, inside: &Array2<bool>) -> Labels {
    let mut areas = vec![0; runs.n_labels];
    let (rows, cols) = inside.dim();
    let mut pixels: Vec<u32> = Vec::with_capacity(inside.len() + BURST);
    for (row, inside) in inside.as_standard_layout().rows().into_iter().enumerate() {
        let inside = inside.to_slice().expect("rows of the standard layout are contiguous");
        if row * cols + BURST >= pixels.len() {
            // A few rows at a time, so that they are still in the cache when they are written.
            let end = rows.min(row + BATCH.div_ceil(cols.max(1)));
            pixels.resize(end * cols + BURST, 0);
        }
        // The pixels after this row belong to the next row, which is written later.
        let line = &mut pixels[row * cols..(row + 1) * cols + BURST];
        let of_row = runs.row_range(row);
        wide_loops::run(
            #[inline(always)]
            || {
                for (&[start, end], &label) in runs.ends[of_row.clone()].iter().zip(&runs.labels[of_row]) {
                    paint(line, start as usize, end as usize, label);
                    areas[label as usize - 1] += (end - start) as usize;
                }
                let n = inside.len();
                in_blocks!(n, clear_in_block(line, inside));
            },
        );
    }
    pixels.truncate(inside.len());
    Labels { image: Array2::from_shape_vec(inside.dim(), pixels).expect("one label for every pixel"), areas }
}

/// Pixels that are initialized together.
const BATCH: usize = 1 << 16;

/// Pixels that are written together.
const BURST: usize = 16;

/// Writes columns `start..end`, and up to [`BURST`] columns after them. Most runs are short, and mispredicted branches of an exact
/// loop cost more than a few additional pixels.
#[inline(always)]
fn paint(line: &mut [u32], start: usize, end: usize, label: u32) {
    let mut at = start;
    while at < end {
        *block_mut(line, at) = [label; BURST];
        at += BURST;
    }
}

/// Sets the label of pixels outside to 0.
#[inline(always)]
fn clear_in_block<T: Copy + Default, const N: usize>(start: usize, line: &mut [T], inside: &[bool]) {
    let (labels, inside): (&mut [T; N], &[bool; N]) = (block_mut(line, start), block(inside, start));
    for i in 0..N {
        labels[i] = if inside[i] { labels[i] } else { T::default() };
    }
}
