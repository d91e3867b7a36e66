//! Dilation and erosion by flat elements, opening and closing.
//!
//! Rows stream through one step, or two for opening and closing, so that what lies between is never more than the rows that the
//! element covers (`rows`).

use crate::element::Shape;
use crate::rows::{Pick, Rows};
use crate::{Element, Level};
use ndarray::Array2;

/// Maximum over the element, turned about its origin, at each pixel. A number is the radius of a square.
pub fn dilate<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    once(image, &element.into().reflected(), T::LOWEST, T::sup)
}

/// Minimum over the element at each pixel. A number is the radius of a square.
pub fn erode<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    once(image, &element.into(), T::HIGHEST, T::inf)
}

/// Erosion, then dilation: what is bright and has no room for the element goes.
pub fn opening<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    let element = element.into();
    twice(image, [&element, &element.reflected()], [T::HIGHEST, T::LOWEST], T::inf, T::sup)
}

/// Dilation, then erosion: what is dark and has no room for the element goes.
pub fn closing<T: Level>(image: &Array2<T>, element: impl Into<Element>) -> Array2<T> {
    let element = element.into();
    twice(image, [&element.reflected(), &element], [T::LOWEST, T::HIGHEST], T::sup, T::inf)
}

fn once<T: Level>(image: &Array2<T>, element: &Element, neutral: T, pick: impl Pick<T>) -> Array2<T> {
    let mut rows = Rows::new(&element.0, image.dim(), neutral);
    of_rows(
        image,
        #[inline(always)]
        |pixels, cols, result| {
            for row in pixels.chunks_exact(cols) {
                rows.push(row, result, pick);
            }
            rows.finish(result, pick);
        },
    )
}

fn twice<T: Level>(
    image: &Array2<T>,
    elements: [&Element; 2],
    neutral: [T; 2],
    first: impl Pick<T>,
    second: impl Pick<T>,
) -> Array2<T> {
    let shapes: [&Shape; 2] = elements.map(|element| &element.0);
    let mut before = Rows::new(shapes[0], image.dim(), neutral[0]);
    let mut after = Rows::new(shapes[1], image.dim(), neutral[1]);
    of_rows(
        image,
        #[inline(always)]
        |pixels, cols, result| {
            let mut between: Vec<T> = Vec::new();
            for row in pixels.chunks_exact(cols) {
                before.push(row, &mut between, first);
                for row in between.chunks_exact(cols) {
                    after.push(row, result, second);
                }
                between.clear();
            }
            before.finish(&mut between, first);
            for row in between.chunks_exact(cols) {
                after.push(row, result, second);
            }
            after.finish(result, second);
        },
    )
}

/// Gathers the rows of the result that `work` makes of pixels and number of columns.
fn of_rows<T: Level>(image: &Array2<T>, work: impl FnOnce(&[T], usize, &mut Vec<T>)) -> Array2<T> {
    let source = image.as_standard_layout();
    let pixels = source.as_slice().expect("standard layout was asked for");
    let mut result = Vec::with_capacity(pixels.len());
    if !pixels.is_empty() {
        wide_loops::run(
            #[inline(always)]
            || work(pixels, image.ncols(), &mut result),
        );
    }
    Array2::from_shape_vec(image.dim(), result).expect("one value for every pixel")
}
