//! Derivatives of max pooling and upsampling.

use kernels::images::{LANES, Planes};

/// Derivative with respect to the image: the derivative with respect to the result, placed at the first maximum of each
/// window.
pub fn max_pool_gradient(image: &Planes, pooled: &Planes, gradient: &Planes, [rows, columns]: [usize; 2]) -> Planes {
    let mut out = Planes::zeros(image.channels(), image.height(), image.width());
    for block in 0..pooled.n_blocks() {
        for y in 0..pooled.height() {
            let mut taken = vec![[false; LANES]; pooled.width()];
            let largest = pooled.row(block, y);
            let gradient = gradient.row(block, y);
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

/// Derivative with respect to the image: the derivative with respect to the result, summed over each window.
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
