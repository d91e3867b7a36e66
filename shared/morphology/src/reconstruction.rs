//! Geodesic reconstruction: a marker grows under a mask until nothing changes (Vincent 1993, the hybrid algorithm).

use crate::blocks::wide;
use crate::padded::{Padded, shifted, sup_across};
use crate::{Connectivity, Level};
use ndarray::Array2;
use std::collections::VecDeque;

/// The marker dilated under the mask for ever: peaks that hold no marker go, the others keep their shape. Where the
/// marker lies above the mask it counts as the mask.
///
/// # Panics
/// If the images differ in size.
pub fn reconstruct_by_dilation<T: Level>(
    marker: &Array2<T>,
    mask: &Array2<T>,
    connectivity: Connectivity,
) -> Array2<T> {
    reconstruct(marker, mask, connectivity, |value| value)
}

/// The marker eroded over the mask for ever. Where the marker lies below the mask it counts as the mask.
///
/// # Panics
/// If the images differ in size.
pub fn reconstruct_by_erosion<T: Level>(marker: &Array2<T>, mask: &Array2<T>, connectivity: Connectivity) -> Array2<T> {
    reconstruct(marker, mask, connectivity, T::complement)
}

/// Fills every basin to the lowest pass out of it, as rain would: a pixel's new height is the least, over all ways to
/// the image's border, of the highest point of the way.
pub fn fill_basins<T: Level>(heights: &Array2<T>, connectivity: Connectivity) -> Array2<T> {
    let (rows, cols) = heights.dim();
    let marker = Array2::from_shape_fn((rows, cols), |(row, col)| {
        let at_border = row == 0 || col == 0 || row + 1 == rows || col + 1 == cols;
        if at_border { heights[[row, col]] } else { T::HIGHEST }
    });
    reconstruct_by_erosion(&marker, heights, connectivity)
}

/// `sense` is the identity, or the complement for the dual.
fn reconstruct<T: Level>(
    marker: &Array2<T>,
    mask: &Array2<T>,
    connectivity: Connectivity,
    sense: impl Fn(T) -> T + Copy,
) -> Array2<T> {
    assert_eq!(marker.dim(), mask.dim(), "marker and mask differ in size");
    let mut values = Padded::mapped(marker, T::LOWEST, sense);
    // Nothing grows into the frame.
    let mask = Padded::mapped(mask, T::LOWEST, sense);
    wide!(sweep(&mut values, &mask, connectivity));
    let mut queue = VecDeque::new();
    wide!(find_unsettled(&values, &mask, connectivity, &mut queue));
    spread(&mut values, &mask, connectivity, queue);
    values.unframed(sense)
}

/// Down and up once: most pixels are settled then.
#[inline(always)]
fn sweep<T: Level>(values: &mut Padded<T>, mask: &Padded<T>, connectivity: Connectivity) {
    let (rows, cols, stride) = (values.rows, values.cols, values.stride);
    for row in 0..rows {
        let (above, at) = values.pixels.split_at_mut((row + 1) * stride);
        let (above, at, limits) = (&above[row * stride..], &mut at[1..=cols], mask.row(row));
        from_across(at, shifted(above, cols), limits, connectivity);
        let mut beside = T::LOWEST;
        for (value, &limit) in at.iter_mut().zip(limits) {
            beside = value.sup(beside).inf(limit);
            *value = beside;
        }
    }
    for row in (0..rows).rev() {
        let (at, below) = values.pixels.split_at_mut((row + 2) * stride);
        let (at, limits) = (&mut at[(row + 1) * stride..][1..=cols], mask.row(row));
        from_across(at, shifted(below, cols), limits, connectivity);
        let mut beside = T::LOWEST;
        for (value, &limit) in at.iter_mut().zip(limits).rev() {
            beside = value.sup(beside).inf(limit);
            *value = beside;
        }
    }
}

#[inline(always)]
fn from_across<T: Level>(at: &mut [T], across: [&[T]; 3], limits: &[T], connectivity: Connectivity) {
    for (i, (value, &limit)) in at.iter_mut().zip(limits).enumerate() {
        *value = value.sup(sup_across(across, i, connectivity)).inf(limit);
    }
}

/// Pixels from which one after them can still grow. Those before them saw them in the way up.
#[inline(always)]
fn find_unsettled<T: Level>(
    values: &Padded<T>,
    mask: &Padded<T>,
    connectivity: Connectivity,
    queue: &mut VecDeque<u32>,
) {
    let n = values.cols;
    // What a pixel must exceed to make this neighbor grow.
    let threshold = |value: T, limit: T| if value < limit { value } else { T::HIGHEST };
    let fill = |into: &mut [T], row: usize| {
        let ([_, v, _], [_, m, _]) = (values.three_rows(row), mask.three_rows(row));
        for ((threshold_here, &value), &limit) in into.iter_mut().zip(v).zip(m) {
            *threshold_here = threshold(value, limit);
        }
    };
    let mut here = vec![T::HIGHEST; values.stride];
    let mut below = here.clone();
    let mut grows = vec![false; n];
    if values.rows > 0 {
        fill(&mut here, 0);
    }
    for row in 0..values.rows {
        if row + 1 < values.rows {
            fill(&mut below, row + 1);
        } else {
            below.fill(T::HIGHEST);
        }
        let ([_, _, right], [before, under, after]) = (shifted(&here, n), shifted(&below, n));
        let line = values.row(row);
        let mut any = false;
        for i in 0..n {
            let mut least = right[i].inf(under[i]);
            if connectivity == Connectivity::Eight {
                least = least.inf(before[i]).inf(after[i]);
            }
            grows[i] = least < line[i];
            any |= grows[i];
        }
        if any {
            let start = values.row_start(row);
            queue.extend(grows.iter().enumerate().filter(|(_, grows)| **grows).map(|(i, _)| (start + i) as u32));
        }
        std::mem::swap(&mut here, &mut below);
    }
}

/// Breadth first from those pixels.
fn spread<T: Level>(values: &mut Padded<T>, mask: &Padded<T>, connectivity: Connectivity, mut queue: VecDeque<u32>) {
    let steps = values.steps(connectivity);
    while let Some(pixel) = queue.pop_front() {
        let value = values.pixels[pixel as usize];
        for &step in &steps {
            let neighbor = (pixel as usize).wrapping_add_signed(step);
            let (old, limit) = (values.pixels[neighbor], mask.pixels[neighbor]);
            if old < value && old < limit {
                values.pixels[neighbor] = value.inf(limit);
                queue.push_back(neighbor as u32);
            }
        }
    }
}
