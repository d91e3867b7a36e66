//! Smaller and larger images.

use super::planes::{Feature, LANES, Planes};

/// The largest of every `factor` rows x columns.
///
/// # Panics
/// If the factors do not divide the image.
pub fn max_pool(image: &Planes, [rows, columns]: [usize; 2]) -> Planes {
    assert_eq!((image.height() % rows, image.width() % columns), (0, 0), "a pool must divide the image");
    let mut out = Planes::zeros(image.channels(), image.height() / rows, image.width() / columns);
    for block in 0..out.n_blocks() {
        for y in 0..out.height() {
            let out_row = out.row_mut(block, y);
            out_row.fill([f32::NEG_INFINITY; LANES]);
            for row in 0..rows {
                let pixels = image.row(block, y * rows + row);
                for (largest, pixels) in out_row.iter_mut().zip(pixels.chunks_exact(columns)) {
                    for pixel in pixels {
                        for lane in 0..LANES {
                            largest[lane] = if pixel[lane] > largest[lane] { pixel[lane] } else { largest[lane] };
                        }
                    }
                }
            }
        }
    }
    out
}

/// Derivative by the image: that by the result, at the first of the largest; pixels without border throughout.
pub fn max_pool_gradient(
    image: &[Feature],
    pooled: &[Feature],
    gradient: &[Feature],
    width: usize,
    [rows, columns]: [usize; 2],
) -> Vec<Feature> {
    let mut out = vec![[0.0; LANES]; image.len()];
    let out_width = width / columns;
    for (i, (largest, gradient)) in pooled.iter().zip(gradient).enumerate() {
        let (x, y) = (i % out_width, i / out_width);
        let mut taken = [false; LANES];
        for row in 0..rows {
            for column in 0..columns {
                let at = (y * rows + row) * width + x * columns + column;
                for lane in 0..LANES {
                    if !taken[lane] && image[at][lane] == largest[lane] {
                        taken[lane] = true;
                        out[at][lane] = gradient[lane];
                    }
                }
            }
        }
    }
    out
}

/// Every pixel repeated over `factor` rows x columns.
pub fn upsample(image: &Planes, [rows, columns]: [usize; 2]) -> Planes {
    let mut out = Planes::zeros(image.channels(), image.height() * rows, image.width() * columns);
    for block in 0..out.n_blocks() {
        for y in 0..out.height() {
            let pixels = image.row(block, y / rows);
            for (out, pixel) in out.row_mut(block, y).chunks_exact_mut(columns).zip(pixels) {
                out.fill(*pixel);
            }
        }
    }
    out
}

/// Derivative by the image: sums of that by the result; pixels without border throughout.
pub fn upsample_gradient(gradient: &[Feature], width: usize, [rows, columns]: [usize; 2]) -> Vec<Feature> {
    let mut out = vec![[0.0; LANES]; gradient.len() / (rows * columns)];
    let out_width = width / columns;
    for (i, gradient) in gradient.iter().enumerate() {
        let (x, y) = (i % width, i / width);
        let sum = &mut out[y / rows * out_width + x / columns];
        sum.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += value);
    }
    out
}
