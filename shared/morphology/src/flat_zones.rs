//! Lambda-quasi-flat zones: pixels joined by a path on which the height never jumps by more than lambda.

use crate::blocks::{block, block_mut, in_blocks};
use crate::components::labels_of;
use crate::labels::Labels;
use crate::neighbors::{Connectivity, Raster};
use crate::runs::{Builder, RowBits, write_words};
use crate::union_find::DisjointSets;
use ndarray::Array2;

/// Zones of the pixels that are `valid`. Two neighbors belong to one zone if their heights differ by at most `lambda`.
///
/// # Panics
/// If the images differ in size.
pub fn quasi_flat_zones(
    heights: &Array2<f32>,
    valid: &Array2<bool>,
    lambda: f32,
    connectivity: Connectivity,
) -> Labels {
    assert_eq!(heights.dim(), valid.dim(), "heights and validity differ in size");
    let (rows, cols) = heights.dim();
    let heights = heights.as_standard_layout();
    let standard = valid.as_standard_layout();
    let z = heights.as_slice().expect("standard layout");
    let inside = standard.as_slice().expect("standard layout");
    let mut builder = Builder::new(cols);
    let mut bits = RowBits::new(cols);
    let mut near = vec![false; cols];
    for row in 0..rows {
        let line = |row: usize| (&z[row * cols..(row + 1) * cols], &inside[row * cols..(row + 1) * cols]);
        let here = line(row);
        let above = line(row.saturating_sub(1));
        wide_loops::run(
            #[inline(always)]
            || {
                write_words(here.1, &mut bits.inside);
                // Pairs of rows and the column offsets of their pixels.
                for (a, b, by, into) in [
                    (here, here, [1, 0], &mut bits.begins),
                    (here, above, [0, 0], &mut bits.up),
                    (here, above, [1, 0], &mut bits.up_left),
                    (here, above, [0, 1], &mut bits.left_up),
                ] {
                    let n = cols.saturating_sub(by[0].max(by[1]));
                    near.fill(false);
                    let lines = [(a.0, a.1, by[0]), (b.0, b.1, by[1])];
                    in_blocks!(n, near_in_block(&mut near[cols - n..], lines, lambda));
                    write_words(&near, into);
                }
                for (begins, inside) in bits.begins.iter_mut().zip(&bits.inside) {
                    *begins = inside & !*begins;
                }
                builder.add_row(&bits, connectivity);
            },
        );
    }
    labels_of(&builder.finish(), valid)
}

/// Whether pairs of pixels are both valid and differ by at most `lambda`. `lines` are the rows with the column of their first pixel.
#[inline(always)]
fn near_in_block<T, const N: usize>(start: usize, into: &mut [T], lines: [(&[f32], &[bool], usize); 2], lambda: f32)
where
    T: From<bool>,
{
    let [a, b] =
        lines.map(|(z, inside, from)| (block::<f32, N>(z, start + from), block::<bool, N>(inside, start + from)));
    let is_near = |i: usize| T::from(a.1[i] & b.1[i] & ((a.0[i] - b.0[i]).abs() <= lambda));
    *block_mut(into, start) = std::array::from_fn::<T, N, _>(is_near);
}

/// Zones of a sparse height image, for example of lidar rings on the ground. Two valid pixels of a row or column
/// without valid pixels between them belong to one zone if they are `g <= steps.len()` pixels apart and their heights
/// differ by at most `steps[g - 1]`. With one step the result equals [`quasi_flat_zones`] with four neighbors.
///
/// Steps that grow with the gap limit the slope. Interpolating the gaps instead would turn vertical edges next to a
/// shadow into ramps.
///
/// # Panics
/// If the images differ in size.
pub fn quasi_flat_zones_over_gaps(heights: &Array2<f32>, valid: &Array2<bool>, steps: &[f32]) -> Labels {
    assert_eq!(heights.dim(), valid.dim(), "heights and validity differ in size");
    let Raster { rows, cols } = Raster::new(heights.dim());
    let heights = heights.as_standard_layout();
    let valid = valid.as_standard_layout();
    let z = heights.as_slice().expect("standard layout");
    let inside = valid.as_slice().expect("standard layout");
    let mut sets = DisjointSets::new(z.len());
    let mut above: Vec<Option<usize>> = vec![None; cols];
    for row in 0..rows {
        let mut left: Option<usize> = None;
        for (col, above) in above.iter_mut().enumerate() {
            let pixel = row * cols + col;
            if !inside[pixel] {
                continue;
            }
            let nearest = [left.map(|l| (l, col - l % cols)), above.map(|a| (a, row - a / cols))];
            for (other, gap) in nearest.into_iter().flatten() {
                if steps.get(gap - 1).is_some_and(|&step| (z[other] - z[pixel]).abs() <= step) {
                    sets.union(other, pixel);
                }
            }
            left = Some(pixel);
            *above = Some(pixel);
        }
    }
    sets.into_labels(heights.dim(), |pixel| inside[pixel])
}
