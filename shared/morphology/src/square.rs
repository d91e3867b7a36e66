//! Dilation and erosion by a flat square in constant time per pixel (van Herk 1992; Gil and Werman 1993).
//!
//! The maximum over a window of `k` pixels is that of two running maxima, one that starts anew at every multiple of `k`
//! and runs forward, one that runs backward: about three comparisons a pixel whatever `k` is. The square is the product
//! of a row and a column.

use crate::Level;
use ndarray::{Array2, Axis, Zip};

/// Maximum over the square of side `2 radius + 1` around each pixel.
pub fn dilate<T: Level>(image: &Array2<T>, radius: usize) -> Array2<T> {
    over_square(image, radius, T::LOWEST, T::sup)
}

/// Minimum over the square of side `2 radius + 1` around each pixel.
pub fn erode<T: Level>(image: &Array2<T>, radius: usize) -> Array2<T> {
    over_square(image, radius, T::HIGHEST, T::inf)
}

/// Erosion, then dilation: what is bright and narrower than the square goes.
pub fn opening<T: Level>(image: &Array2<T>, radius: usize) -> Array2<T> {
    dilate(&erode(image, radius), radius)
}

/// Dilation, then erosion: what is dark and narrower than the square goes.
pub fn closing<T: Level>(image: &Array2<T>, radius: usize) -> Array2<T> {
    erode(&dilate(image, radius), radius)
}

fn over_square<T: Level>(image: &Array2<T>, radius: usize, neutral: T, pick: impl Fn(T, T) -> T + Copy) -> Array2<T> {
    let mut result = image.to_owned().as_standard_layout().into_owned();
    if radius > 0 && !result.is_empty() {
        along_rows(&mut result, radius, neutral, pick);
        along_columns(&mut result, radius, neutral, pick);
    }
    result
}

/// The window slides along each row.
fn along_rows<T: Level>(image: &mut Array2<T>, radius: usize, neutral: T, pick: impl Fn(T, T) -> T) {
    let n = image.ncols();
    // A window that reaches past both ends sees the whole line already.
    let radius = radius.min(n);
    let side = 2 * radius + 1;
    let mut forward = vec![neutral; n + 2 * radius];
    let mut backward = forward.clone();
    for mut line in image.rows_mut() {
        let line = line.as_slice_mut().expect("rows of the standard layout are contiguous");
        forward[radius..radius + n].copy_from_slice(line);
        backward.copy_from_slice(&forward);
        for i in (1..forward.len()).filter(|i| i % side != 0) {
            forward[i] = pick(forward[i - 1], forward[i]);
        }
        for i in (0..backward.len() - 1).rev().filter(|i| (i + 1) % side != 0) {
            backward[i] = pick(backward[i + 1], backward[i]);
        }
        for (i, pixel) in line.iter_mut().enumerate() {
            *pixel = pick(backward[i], forward[i + 2 * radius]);
        }
        forward[..radius].fill(neutral);
        forward[radius + n..].fill(neutral);
    }
}

/// The window slides along each column; whole rows at a time, so that memory is read in order.
fn along_columns<T: Level>(image: &mut Array2<T>, radius: usize, neutral: T, pick: impl Fn(T, T) -> T + Copy) {
    let (n, cols) = image.dim();
    let radius = radius.min(n);
    let side = 2 * radius + 1;
    let mut forward = Array2::from_elem((n + 2 * radius, cols), neutral);
    forward.slice_mut(ndarray::s![radius..radius + n, ..]).assign(image);
    let mut backward = forward.clone();
    let n_padded = forward.nrows();
    for i in (1..n_padded).filter(|i| i % side != 0) {
        let (done, mut rest) = forward.view_mut().split_at(Axis(0), i);
        Zip::from(rest.row_mut(0)).and(done.row(i - 1)).for_each(|value, &before| *value = pick(before, *value));
    }
    for i in (0..n_padded - 1).rev().filter(|i| (i + 1) % side != 0) {
        let (mut rest, done) = backward.view_mut().split_at(Axis(0), i + 1);
        Zip::from(rest.row_mut(i)).and(done.row(0)).for_each(|value, &after| *value = pick(after, *value));
    }
    for (i, row) in image.rows_mut().into_iter().enumerate() {
        Zip::from(row)
            .and(backward.row(i))
            .and(forward.row(i + 2 * radius))
            .for_each(|pixel, &back, &fore| *pixel = pick(back, fore));
    }
}
