//! Geodesic reconstruction: a marker grows under a mask until nothing changes (Vincent 1993, the hybrid algorithm).

use crate::neighbors::Raster;
use crate::{Connectivity, Level};
use ndarray::Array2;
use std::cmp::Ordering;
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
    reconstruct(marker, mask, connectivity, T::order, T::sup, T::inf)
}

/// The marker eroded over the mask for ever. Where the marker lies below the mask it counts as the mask.
///
/// # Panics
/// If the images differ in size.
pub fn reconstruct_by_erosion<T: Level>(marker: &Array2<T>, mask: &Array2<T>, connectivity: Connectivity) -> Array2<T> {
    reconstruct(marker, mask, connectivity, |a, b| b.order(a), T::inf, T::sup)
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

/// `grow` is the supremum in the direction of growth, `bound` holds a value back to the mask.
fn reconstruct<T: Level>(
    marker: &Array2<T>,
    mask: &Array2<T>,
    connectivity: Connectivity,
    order: impl Fn(T, T) -> Ordering,
    grow: impl Fn(T, T) -> T,
    bound: impl Fn(T, T) -> T,
) -> Array2<T> {
    assert_eq!(marker.dim(), mask.dim(), "marker and mask differ in size");
    let raster = Raster::new(mask.dim());
    let mask = mask.as_standard_layout();
    let mask = mask.as_slice().expect("standard layout was asked for");
    let mut result = marker.as_standard_layout().into_owned();
    let values = result.as_slice_mut().expect("standard layout was asked for");
    for (value, &limit) in values.iter_mut().zip(mask) {
        *value = bound(*value, limit);
    }

    let sweep = |values: &mut [T], pixel: usize, sign: isize| {
        let mut value = values[pixel];
        for &(row, col) in connectivity.before() {
            if let Some(neighbor) = raster.neighbor(pixel, (sign * row, sign * col)) {
                value = grow(value, values[neighbor]);
            }
        }
        values[pixel] = bound(value, mask[pixel]);
    };
    for pixel in 0..values.len() {
        sweep(values, pixel, 1);
    }
    for pixel in (0..values.len()).rev() {
        sweep(values, pixel, -1);
    }

    // Two sweeps settle most pixels; the queue carries on where a neighbor can still grow.
    let can_grow = |values: &[T], from: usize, to: usize| {
        order(values[to], values[from]) == Ordering::Less && order(values[to], mask[to]) == Ordering::Less
    };
    let mut queue: VecDeque<usize> = (0..values.len())
        .filter(|&pixel| raster.neighbors(pixel, connectivity).any(|other| can_grow(values, pixel, other)))
        .collect();
    while let Some(pixel) = queue.pop_front() {
        for other in raster.neighbors(pixel, connectivity) {
            if can_grow(values, pixel, other) {
                values[other] = bound(values[pixel], mask[other]);
                queue.push_back(other);
            }
        }
    }
    result
}
