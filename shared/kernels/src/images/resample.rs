//! Max pooling and upsampling.

use super::planes::{Feature, LANES, Planes};
use std::ops::{Deref, DerefMut};

/// The maximum of each window of rows x columns; writes all of `out` except its border.
///
/// # Panics
/// If the size of the image is not the size of `out` times the factor.
pub fn max_pool<S, O>(image: &Planes<S>, [rows, columns]: [usize; 2], out: &mut Planes<O>)
where
    S: Deref<Target = [Feature]>,
    O: DerefMut<Target = [Feature]>,
{
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

/// Repeats every pixel over rows x columns; writes all of `out` except its border.
///
/// # Panics
/// If the size of `out` is not the size of the image times the factor.
pub fn upsample<S, O>(image: &Planes<S>, [rows, columns]: [usize; 2], out: &mut Planes<O>)
where
    S: Deref<Target = [Feature]>,
    O: DerefMut<Target = [Feature]>,
{
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
