//! Lambda-quasi-flat zones: pixels joined by a path on which the height never jumps by more than lambda.

use crate::neighbors::Raster;
use crate::union_find::DisjointSets;
use crate::{Connectivity, Labels};
use ndarray::Array2;

/// Zones of the pixels that are `valid`: two neighbors belong together if their heights differ by at most `lambda`.
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
    let raster = Raster::new(heights.dim());
    let (heights, valid) = (heights.as_standard_layout(), valid.as_standard_layout());
    let (z, inside) = (heights.as_slice().expect("standard layout"), valid.as_slice().expect("standard layout"));
    let mut sets = DisjointSets::new(z.len());
    for pixel in (0..z.len()).filter(|&pixel| inside[pixel]) {
        for &offset in connectivity.before() {
            if let Some(before) = raster.neighbor(pixel, offset)
                && inside[before]
                && (z[before] - z[pixel]).abs() <= lambda
            {
                sets.union(before, pixel);
            }
        }
    }
    sets.into_labels(heights.dim(), |pixel| inside[pixel])
}

/// Zones of a sparse height image, such as the rings that a lidar draws on the ground: two valid pixels of a row or of a
/// column with nothing valid between them belong together if they are `g <= steps.len()` pixels apart and their
/// heights differ by at most `steps[g - 1]`. With one step this is [`quasi_flat_zones`] with four neighbors.
///
/// A step that grows with the gap bounds the slope along the way, where interpolating the gaps first would turn every
/// cliff beside a shadow into a ramp.
///
/// # Panics
/// If the images differ in size.
pub fn quasi_flat_zones_over_gaps(heights: &Array2<f32>, valid: &Array2<bool>, steps: &[f32]) -> Labels {
    assert_eq!(heights.dim(), valid.dim(), "heights and validity differ in size");
    let Raster { rows, cols } = Raster::new(heights.dim());
    let (heights, valid) = (heights.as_standard_layout(), valid.as_standard_layout());
    let (z, inside) = (heights.as_slice().expect("standard layout"), valid.as_slice().expect("standard layout"));
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
