//! Dilation and erosion by flat elements, opening and closing.
//!
//! Rows stream through one operator (`rows`), or two for opening and closing. The intermediate image is never larger than the rows that
//! the element covers.

use crate::element::{Element, Shape};
use crate::level::Level;
use crate::picks::Pick;
use crate::rows::Rows;
use crate::source::Source;
use ndarray::Array2;

/// Dilation: maximum over the reflected element. A number is the radius of a square.
pub fn dilate<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    once(image, &element.into().reflected(), T::LOWEST, T::sup)
}

/// Erosion: minimum over the element. A number is the radius of a square.
pub fn erode<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    once(image, &element.into(), T::HIGHEST, T::inf)
}

/// Opening: erosion, then dilation. Removes bright structures that do not contain the element.
pub fn opening<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    let element = element.into();
    twice(image, [&element, &element.reflected()], [T::HIGHEST, T::LOWEST], T::inf, T::sup)
}

/// Closing: dilation, then erosion. Removes dark structures that do not contain the element.
pub fn closing<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    let element = element.into();
    twice(image, [&element.reflected(), &element], [T::LOWEST, T::HIGHEST], T::sup, T::inf)
}

fn once<T: Level>(image: &Array2<T>, element: &Element, neutral: T, pick: impl Pick<T>) -> Array2<T> {
    let mut rows = Rows::new(&element.0, image.dim(), neutral);
    map_row_pairs(image, neutral, |pixels, first, into| rows.pair(first, pixels, into, pick))
}

fn twice<T: Level>(
    image: &Array2<T>,
    elements: [&Element; 2],
    neutral: [T; 2],
    first: impl Pick<T>,
    second: impl Pick<T>,
) -> Array2<T> {
    let (rows, cols) = image.dim();
    let shapes: [&Shape; 2] = elements.map(|element| &element.0);
    let mut before = Rows::new(shapes[0], image.dim(), neutral[0]);
    let mut after = Rows::new(shapes[1], image.dim(), neutral[1]);
    // Rows that the second operator needs, in pairs, and one pair more.
    let span = 2 * after.reach() + 4;
    let mut between = vec![neutral[0]; span * cols];
    let mut n_between = 0;
    map_row_pairs(image, neutral[1], |pixels, row, into| {
        while n_between < rows.min(row + 2 + after.reach()) {
            let start = n_between % span * cols;
            before.pair(n_between, pixels, &mut between[start..start + 2 * cols], first);
            n_between += 2;
        }
        after.pair(row, Source { pixels: &between, cols, span }, into, second);
    })
}

/// Bytes of the result that are initialized together. They are still in the second-level cache when they are written.
const BATCH: usize = 1 << 18;

/// Collects the result. `pair` receives the image and the number of a row, and writes this row and the next.
fn map_row_pairs<T: Level>(
    image: &Array2<T>,
    neutral: T,
    mut pair: impl FnMut(Source<'_, T>, usize, &mut [T]),
) -> Array2<T> {
    let (rows, cols) = image.dim();
    let image = image.as_standard_layout();
    let pixels = image.as_slice().expect("as_standard_layout was called");
    // The second row of the last pair may lie below the image.
    let mut result = Vec::with_capacity(pixels.len() + cols);
    if !pixels.is_empty() {
        let source = Source { pixels, cols, span: rows };
        let n_batch = 2 * BATCH.div_ceil(2 * cols * size_of::<T>());
        for start in (0..rows).step_by(n_batch) {
            let end = rows.next_multiple_of(2).min(start + n_batch);
            result.resize(end * cols, neutral);
            for (row, into) in (start..end).step_by(2).zip(result[start * cols..].chunks_exact_mut(2 * cols)) {
                pair(source, row, into);
            }
        }
        result.truncate(pixels.len());
    }
    Array2::from_shape_vec((rows, cols), result).expect("one value for every pixel")
}
