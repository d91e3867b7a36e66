//! Geodesic reconstruction: a marker grows under a mask until it is stable (hybrid algorithm of Vincent 1993).

use crate::level::Level;
use crate::neighbors::Connectivity;
use crate::padded::{Padded, shifted, sup_across};
use ndarray::Array2;
use std::collections::VecDeque;

/// Reconstruction by dilation: peaks without marker are removed, others keep their shape. A marker above the mask is clipped to the
/// mask.
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

/// Reconstruction by erosion. A marker below the mask is clipped to the mask.
///
/// # Panics
/// If the images differ in size.
pub fn reconstruct_by_erosion<T: Level>(marker: &Array2<T>, mask: &Array2<T>, connectivity: Connectivity) -> Array2<T> {
    reconstruct(marker, mask, connectivity, T::complement)
}

/// Fills every basin to its lowest pass: the new height of a pixel is the minimum, over all paths to the border of the image, of the
/// highest point of the path.
pub fn fill_basins<T: Level>(heights: &Array2<T>, connectivity: Connectivity) -> Array2<T> {
    let (rows, cols) = heights.dim();
    let marker = Array2::from_shape_fn((rows, cols), |(row, col)| {
        let at_border = row == 0 || col == 0 || row + 1 == rows || col + 1 == cols;
        if at_border { heights[[row, col]] } else { T::HIGHEST }
    });
    reconstruct_by_erosion(&marker, heights, connectivity)
}

/// `sense` is the identity, or the complement for the dual operator.
fn reconstruct<T: Level>(
    marker: &Array2<T>,
    mask: &Array2<T>,
    connectivity: Connectivity,
    sense: impl Fn(T) -> T + Copy,
) -> Array2<T> {
    assert_eq!(marker.dim(), mask.dim(), "marker and mask differ in size");
    let mut values = Padded::mapped(marker, T::LOWEST, sense);
    // The frame has the lowest limit, so nothing grows into it.
    let mask = Padded::mapped(mask, T::LOWEST, sense);
    wide_loops::run(
        #[inline(always)]
        || sweep(&mut values, &mask, connectivity),
    );
    let mut queue = VecDeque::new();
    wide_loops::run(
        #[inline(always)]
        || find_unsettled(&values, &mask, connectivity, &mut queue),
    );
    spread(&mut values, &mask, connectivity, queue);
    values.unframed(sense)
}

/// One sweep down and one up, which settle most pixels.
#[inline(always)]
fn sweep<T: Level>(values: &mut Padded<T>, mask: &Padded<T>, connectivity: Connectivity) {
    let rows = values.rows;
    let cols = values.cols;
    let stride = values.stride;
    for row in 0..rows {
        let (above, at) = values.pixels.split_at_mut((row + 1) * stride);
        let above = &above[row * stride..];
        let at = &mut at[1..=cols];
        let limits = mask.row(row);
        from_across(at, shifted(above, cols), limits, connectivity);
        let mut previous = T::LOWEST;
        for (value, &limit) in at.iter_mut().zip(limits) {
            previous = value.sup(previous).inf(limit);
            *value = previous;
        }
    }
    for row in (0..rows).rev() {
        let (at, below) = values.pixels.split_at_mut((row + 2) * stride);
        let at = &mut at[(row + 1) * stride..][1..=cols];
        let limits = mask.row(row);
        from_across(at, shifted(below, cols), limits, connectivity);
        let mut previous = T::LOWEST;
        for (value, &limit) in at.iter_mut().zip(limits).rev() {
            previous = value.sup(previous).inf(limit);
            *value = previous;
        }
    }
}

#[inline(always)]
fn from_across<T: Level>(at: &mut [T], across: [&[T]; 3], limits: &[T], connectivity: Connectivity) {
    for (i, (value, &limit)) in at.iter_mut().zip(limits).enumerate() {
        *value = value.sup(sup_across(across, i, connectivity)).inf(limit);
    }
}

/// Finds pixels from which a later neighbor can still grow. Earlier neighbors were updated in the sweep up.
#[inline(always)]
fn find_unsettled<T: Level>(
    values: &Padded<T>,
    mask: &Padded<T>,
    connectivity: Connectivity,
    queue: &mut VecDeque<u32>,
) {
    let n = values.cols;
    // Value that a pixel must exceed to make this neighbor grow.
    let threshold = |value: T, limit: T| if value < limit { value } else { T::HIGHEST };
    let fill = |into: &mut [T], row: usize| {
        let [_, v, _] = values.three_rows(row);
        let [_, m, _] = mask.three_rows(row);
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
        let [_, _, right] = shifted(&here, n);
        let [before, under, after] = shifted(&below, n);
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

/// Grows breadth-first from the pixels in the queue.
fn spread<T: Level>(values: &mut Padded<T>, mask: &Padded<T>, connectivity: Connectivity, mut queue: VecDeque<u32>) {
    let steps = values.steps(connectivity);
    while let Some(pixel) = queue.pop_front() {
        let value = values.pixels[pixel as usize];
        for &step in &steps {
            let neighbor = (pixel as usize).wrapping_add_signed(step);
            let old = values.pixels[neighbor];
            let limit = mask.pixels[neighbor];
            if old < value && old < limit {
                values.pixels[neighbor] = value.inf(limit);
                queue.push_back(neighbor as u32);
            }
        }
    }
}
