//! Interpolation of missing heights.

use crate::neighbors::{Connectivity, Raster};
use ndarray::Array2;
use std::collections::VecDeque;

/// Interpolates the heights of pixels that are not `valid`. `None` if no pixel is valid.
///
/// Gaps between two valid pixels of a row or column are interpolated linearly. Where a row and a column cross, both are weighted by the
/// inverse length of their gaps. Remaining pixels get the height of the nearest pixel (city-block distance, ties in raster order). Gaps
/// in a plane are filled with the plane, so sloped streets are interpolated correctly. No result is higher or lower than the valid
/// pixels.
///
/// # Panics
/// If the images differ in size.
pub fn fill_gaps(heights: &Array2<f32>, valid: &Array2<bool>) -> Option<Array2<f32>> {
    assert_eq!(heights.dim(), valid.dim(), "heights and validity differ in size");
    let raster = Raster::new(heights.dim());
    let heights = heights.as_standard_layout();
    let valid = valid.as_standard_layout();
    let z = heights.as_slice().expect("standard layout");
    let known = valid.as_slice().expect("standard layout");
    if !known.contains(&true) {
        return None;
    }
    let mut bridges = Bridges { sums: vec![0.0; z.len()], weights: vec![0.0; z.len()] };
    let mut above: Vec<Option<usize>> = vec![None; raster.cols];
    for row in 0..raster.rows {
        let mut left: Option<usize> = None;
        for (col, above) in above.iter_mut().enumerate() {
            let pixel = row * raster.cols + col;
            if known[pixel] {
                if let Some(left) = left {
                    bridges.span(z, left, pixel, 1);
                }
                if let Some(above) = *above {
                    bridges.span(z, above, pixel, raster.cols);
                }
                left = Some(pixel);
                *above = Some(pixel);
            }
        }
    }
    let mut filled: Vec<f32> = (0..z.len()).map(|i| if known[i] { z[i] } else { bridges.height(i) }).collect();
    spread(raster, &mut filled);
    Some(Array2::from_shape_vec(heights.dim(), filled).expect("one height for every pixel"))
}

struct Bridges {
    sums: Vec<f32>,
    weights: Vec<f32>,
}

impl Bridges {
    /// Adds the line between two valid pixels to the pixels between them.
    fn span(&mut self, z: &[f32], from: usize, to: usize, stride: usize) {
        let weight = stride as f32 / (to - from) as f32;
        for (step, pixel) in (from + stride..to).step_by(stride).enumerate() {
            let share = (step + 1) as f32 * weight;
            self.sums[pixel] += weight * (z[from] * (1.0 - share) + z[to] * share);
            self.weights[pixel] += weight;
        }
    }
    /// Weighted mean of the lines; NaN without lines.
    fn height(&self, pixel: usize) -> f32 {
        if self.weights[pixel] > 0.0 { self.sums[pixel] / self.weights[pixel] } else { f32::NAN }
    }
}

/// Spreads heights breadth-first into pixels without height (NaN).
fn spread(raster: Raster, filled: &mut [f32]) {
    let at_edge = |filled: &[f32], pixel: usize| {
        !filled[pixel].is_nan() && raster.neighbors(pixel, Connectivity::Four).any(|other| filled[other].is_nan())
    };
    let mut queue: VecDeque<usize> = (0..filled.len()).filter(|&pixel| at_edge(filled, pixel)).collect();
    while let Some(pixel) = queue.pop_front() {
        for other in raster.neighbors(pixel, Connectivity::Four) {
            if filled[other].is_nan() {
                filled[other] = filled[pixel];
                queue.push_back(other);
            }
        }
    }
}
