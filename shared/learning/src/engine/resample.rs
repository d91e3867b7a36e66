//! Smaller and larger images.

use super::planes::{LANES, Planes};

/// The largest of every `factor` rows x columns, written to all but the border of `out`.
///
/// # Panics
/// If `out` is not that many times smaller than the image.
pub fn max_pool(image: &Planes, [rows, columns]: [usize; 2], out: &mut Planes) {
    let expected = (image.channels(), image.height(), image.width());
    assert_eq!((out.channels(), out.height() * rows, out.width() * columns), expected, "a pool must divide the image");
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
}

/// Derivative by the image: that by the result, at the first of the largest.
pub fn max_pool_gradient(image: &Planes, pooled: &Planes, gradient: &Planes, [rows, columns]: [usize; 2]) -> Planes {
    let mut out = Planes::zeros(image.channels(), image.height(), image.width());
    for block in 0..pooled.n_blocks() {
        for y in 0..pooled.height() {
            let mut taken = vec![[false; LANES]; pooled.width()];
            let (largest, gradient) = (pooled.row(block, y), gradient.row(block, y));
            for row in y * rows..(y + 1) * rows {
                let pixels = image.row(block, row).chunks_exact(columns);
                let out = out.row_mut(block, row).chunks_exact_mut(columns);
                for ((((pixels, out), taken), largest), gradient) in
                    pixels.zip(out).zip(&mut taken).zip(largest).zip(gradient)
                {
                    for (pixel, out) in pixels.iter().zip(out) {
                        for lane in 0..LANES {
                            let takes = !taken[lane] && pixel[lane] == largest[lane];
                            taken[lane] |= takes;
                            out[lane] = if takes { gradient[lane] } else { 0.0 };
                        }
                    }
                }
            }
        }
    }
    out
}

/// Every pixel repeated over `factor` rows x columns, written to all but the border of `out`.
///
/// # Panics
/// If `out` is not that many times larger than the image.
pub fn upsample(image: &Planes, [rows, columns]: [usize; 2], out: &mut Planes) {
    let expected = (image.channels(), image.height() * rows, image.width() * columns);
    assert_eq!((out.channels(), out.height(), out.width()), expected);
    for block in 0..out.n_blocks() {
        for y in 0..out.height() {
            let pixels = image.row(block, y / rows);
            for (out, pixel) in out.row_mut(block, y).chunks_exact_mut(columns).zip(pixels) {
                out.fill(*pixel);
            }
        }
    }
}

/// Derivative by the image: sums of that by the result.
pub fn upsample_gradient(gradient: &Planes, [rows, columns]: [usize; 2]) -> Planes {
    let mut out = Planes::zeros(gradient.channels(), gradient.height() / rows, gradient.width() / columns);
    for block in 0..out.n_blocks() {
        for y in 0..gradient.height() {
            let sums = out.row_mut(block, y / rows).iter_mut();
            for (sum, pixels) in sums.zip(gradient.row(block, y).chunks_exact(columns)) {
                for pixel in pixels {
                    sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
                }
            }
        }
    }
    out
}
