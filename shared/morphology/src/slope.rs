//! Images that do not rise too fast.

use crate::neighbors::Raster;
use ndarray::Array2;
use std::f32::consts::SQRT_2;

/// The highest image that is nowhere above this one and rises by at most `rise` across an edge between pixels, sqrt(2) times that
/// across a corner: an erosion by a cone, in two passes over the image (Borgefors 1986). Along other directions than these eight the
/// slope comes out up to 8 % steeper. Pixels at infinity limit nothing.
pub fn limit_rise(image: &Array2<f32>, rise: f32) -> Array2<f32> {
    let Raster { rows, cols } = Raster::new(image.dim());
    let mut pixels: Vec<f32> = image.iter().copied().collect();
    // The way back is the way there on the image turned around.
    for _ in 0..2 {
        for row in 0..rows {
            let (before, rest) = pixels.split_at_mut(row * cols);
            let row = &mut rest[..cols];
            if let Some(start) = before.len().checked_sub(cols) {
                limit_by_row_before(row, &before[start..], rise);
            }
            for col in 1..cols {
                row[col] = row[col].min(row[col - 1] + rise);
            }
        }
        pixels.reverse();
    }
    Array2::from_shape_vec((rows, cols), pixels).expect("one value for every pixel")
}

fn limit_by_row_before(row: &mut [f32], before: &[f32], rise: f32) {
    for (col, pixel) in row.iter_mut().enumerate() {
        // At the sides a corner is the pixel before itself, which limits more across the edge.
        let corner = before[col.saturating_sub(1)].min(before[(col + 1).min(before.len() - 1)]);
        *pixel = pixel.min(before[col] + rise).min(corner + SQRT_2 * rise);
    }
}
