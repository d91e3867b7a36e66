//! Connected components of a binary image.

use crate::Connectivity;
use crate::blocks::{block, block_mut, in_blocks};
use crate::runs::{Builder, RowBits, Runs, to_the_left, write_words};
use ndarray::Array2;

/// A partition of some pixels into components.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// Label of each pixel: 1, 2 … in raster order of the components' first pixels, 0 for none.
    pub image: Array2<u32>,
    /// Pixels of label `i + 1`.
    pub areas: Vec<usize>,
}

impl Labels {
    /// Number of components.
    pub fn n(&self) -> usize {
        self.areas.len()
    }
    /// Area of a label in pixels, 0 for label 0 and past the last.
    pub fn area(&self, label: u32) -> usize {
        (label as usize).checked_sub(1).and_then(|idx| self.areas.get(idx)).copied().unwrap_or(0)
    }
}

/// Components of the pixels that are `true`.
pub fn connected_components(mask: &Array2<bool>, connectivity: Connectivity) -> Labels {
    Labels::of(&runs_of(mask, connectivity), mask)
}

/// Runs of pixels that are `true`, and the components that they make up.
pub(crate) fn runs_of(mask: &Array2<bool>, connectivity: Connectivity) -> Runs {
    let mask = mask.as_standard_layout();
    let mut builder = Builder::new(mask.ncols());
    let (mut above, mut row) = (RowBits::new(mask.ncols()), RowBits::new(mask.ncols()));
    for pixels in mask.rows() {
        let pixels = pixels.to_slice().expect("rows of the standard layout are contiguous");
        wide_loops::run(
            #[inline(always)]
            || {
                write_words(pixels, &mut row.inside);
                let (mut left, mut left_above) = (0, 0);
                for (idx, (&here, &up)) in row.inside.iter().zip(&above.inside).enumerate() {
                    row.begins[idx] = here & !to_the_left(here, left);
                    row.up[idx] = here & up;
                    row.up_left[idx] = here & to_the_left(up, left_above);
                    row.left_up[idx] = to_the_left(here, left) & up;
                    (left, left_above) = (here, up);
                }
                builder.add_row(&row, connectivity);
            },
        );
        std::mem::swap(&mut row, &mut above);
    }
    builder.finish()
}

impl Labels {
    /// Of an image whose pixels are `inside` where runs are.
    pub(crate) fn of(runs: &Runs, inside: &Array2<bool>) -> Self {
        let mut areas = vec![0; runs.n_labels];
        let mut pixels: Vec<u32> = Vec::with_capacity(inside.len());
        let mut line = vec![0; inside.ncols() + BURST];
        for (row, inside) in inside.as_standard_layout().rows().into_iter().enumerate() {
            let inside = inside.to_slice().expect("rows of the standard layout are contiguous");
            let of_row = runs.of_row(row);
            wide_loops::run(
                #[inline(always)]
                || {
                    for (&[start, end], &label) in runs.ends[of_row.clone()].iter().zip(&runs.labels[of_row]) {
                        paint(&mut line, start as usize, end as usize, label);
                        areas[label as usize - 1] += (end - start) as usize;
                    }
                    let n = inside.len();
                    in_blocks!(n, clear_in_block(&mut line, inside));
                },
            );
            pixels.extend_from_slice(&line[..inside.len()]);
        }
        Self { image: Array2::from_shape_vec(inside.dim(), pixels).expect("one label for every pixel"), areas }
    }
}

/// Pixels that are written at once.
const BURST: usize = 16;

/// Writes columns `start..end`, and perhaps some after them: most runs are short, and a loop that stops at a column that
/// cannot be foreseen costs more than a few pixels too many.
#[inline(always)]
fn paint(line: &mut [u32], start: usize, end: usize, label: u32) {
    let mut at = start;
    while at < end {
        *block_mut(line, at) = [label; BURST];
        at += BURST;
    }
}

/// Pixels that are not inside get label 0.
#[inline(always)]
fn clear_in_block<T: Copy + Default, const N: usize>(start: usize, line: &mut [T], inside: &[bool]) {
    let (labels, inside): (&mut [T; N], &[bool; N]) = (block_mut(line, start), block(inside, start));
    for i in 0..N {
        labels[i] = if inside[i] { labels[i] } else { T::default() };
    }
}
