//! Images with limited slope.

use crate::neighbors::Raster;
use ndarray::Array2;
use std::f32::consts::SQRT_2;

/// The highest image below this one that rises by at most `rise` between edge neighbors and `sqrt(2) rise` between corner neighbors:
/// an erosion by a cone, in two passes (Borgefors 1986). In directions between these eight the slope is up to 8 % steeper. Infinite
/// pixels impose no limit.
pub fn limit_rise(image: &Array2<f32>, rise: f32) -> Array2<f32> {
    let Raster { rows, cols } = Raster::new(image.dim());
    let mut pixels: Vec<f32> = image.iter().copied().collect();
    // The second pass is the first pass on the reversed image.
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
        // At the sides the corner is replaced by the edge neighbor, whose own limit is stronger.
        let corner = before[col.saturating_sub(1)].min(before[(col + 1).min(before.len() - 1)]);
        *pixel = pixel.min(before[col] + rise).min(corner + SQRT_2 * rise);
    }
}
