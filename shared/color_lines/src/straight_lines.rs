//! Straight lines through the origin: the baseline of Graph-based Color Lines.
//!
//! Dynamic Color Lines uses the directions that are frequent in the image. Refined lines are the best result of
//! alternating assignment and refitting from this start: each pixel belongs to the nearest line, each line is the
//! principal axis of its pixels through the origin.

use crate::ColorLinesError;
use crate::histogram::Cells;
use crate::image::{Image, Pixels};
use crate::projection::Projection;
use crate::space::Points;
use nalgebra::{Matrix3, SymmetricEigen};

/// Number of cells of the histogram of directions along its longest axis.
const BINS: usize = 32;
/// Largest number of refinement passes; refinement ends when no pixel changes its line.
const MAX_PASSES: usize = 50;

/// Method of finding straight lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StraightLines {
    /// The maxima of highest contrast of the histogram of directions.
    Frequent,
    /// The maxima of highest contrast, refined.
    Refined,
}

/// Projects each pixel of an image of three bands onto the nearest of up to `n_lines` straight lines through the origin.
pub fn project_onto_straight_lines(
    image: &Image<'_>,
    n_lines: usize,
    method: StraightLines,
) -> Result<Projection, ColorLinesError> {
    if image.n_bands() != 3 {
        return Err(ColorLinesError::Bands { found: image.n_bands(), expected: 3 });
    }
    let pixels = image.pixels();
    let colors: Vec<[f64; 3]> =
        (0..pixels.len()).map(|index| [0, 1, 2].map(|band| f64::from(pixels.bands[band][index]))).collect();
    let mut lines = frequent_directions(&colors, n_lines)?;
    if method == StraightLines::Refined {
        refine(&colors, &mut lines);
    }
    Ok(project(image, &pixels, &colors, &lines))
}

fn frequent_directions(colors: &[[f64; 3]], n_lines: usize) -> Result<Vec<[f64; 3]>, ColorLinesError> {
    let directions: Vec<[f64; 3]> = colors.iter().filter_map(|color| unit(*color)).collect();
    if directions.is_empty() {
        return Err(ColorLinesError::Empty);
    }
    let points = Points([0, 1, 2].map(|k| directions.iter().map(|direction| direction[k]).collect()));
    let cells = Cells::new(&points, BINS);
    let numbers: Vec<u32> = (0..directions.len() as u32).collect();
    let mut counts = Vec::new();
    let histogram = cells.histogram(&points, &numbers, &mut counts);
    let maxima = cells.maxima(&histogram, &mut counts);
    Ok(maxima.iter().take(n_lines.max(1)).filter_map(|maximum| unit(maximum.mean)).collect())
}

fn refine(colors: &[[f64; 3]], lines: &mut [[f64; 3]]) {
    let mut line_of = vec![usize::MAX; colors.len()];
    for _ in 0..MAX_PASSES {
        let mut has_changed = false;
        let mut products = vec![Matrix3::<f64>::zeros(); lines.len()];
        for (color, of) in colors.iter().zip(&mut line_of) {
            let found = nearest(color, lines);
            has_changed |= *of != found;
            *of = found;
            let color = nalgebra::Vector3::from(*color);
            products[found] += color * color.transpose();
        }
        if !has_changed {
            break;
        }
        for (line, products) in lines.iter_mut().zip(products).filter(|(_, products)| products.trace() > 0.0) {
            let eigen = SymmetricEigen::new(products);
            *line = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned().into();
        }
    }
}

fn project(image: &Image<'_>, pixels: &Pixels, colors: &[[f64; 3]], lines: &[[f64; 3]]) -> Projection {
    let mut projection = Projection::empty(image);
    for (at, color) in pixels.at.iter().zip(colors) {
        let at = *at as usize;
        let number = nearest(color, lines);
        let along = dot(color, &lines[number]);
        projection.lines[at] = number as u32 + 1;
        for (band, component) in lines[number].iter().enumerate() {
            projection.values[band * image.n_pixels() + at] = (along * component) as f32;
        }
    }
    projection
}

/// The line with the smallest angle to a color.
fn nearest(color: &[f64; 3], lines: &[[f64; 3]]) -> usize {
    let along = |line: &[f64; 3]| dot(color, line).abs();
    (1..lines.len()).fold(0, |best, line| if along(&lines[line]) > along(&lines[best]) { line } else { best })
}

/// Direction of a color; `None` for black.
fn unit(color: [f64; 3]) -> Option<[f64; 3]> {
    let norm = dot(&color, &color).sqrt();
    (norm > 0.0).then(|| color.map(|value| value / norm))
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_directions_are_found_and_noise_around_them_is_refined() {
        let mut random = random::Random::new(1);
        let mut values = vec![0.0; 3 * 2000];
        for at in 0..2000 {
            let length = random.range(20.0, 200.0);
            let color = if at % 3 == 0 { [0.8, 0.6, 0.0] } else { [0.0, 0.6, 0.8] };
            for (band, component) in color.iter().enumerate() {
                values[band * 2000 + at] = (length * component + 2.0 * random.gauss()).max(0.0);
            }
        }
        let image = Image::new([50, 40], 3, &values).expect("an image");
        let error = |n_lines, method| {
            let found = project_onto_straight_lines(&image, n_lines, method).expect("three bands");
            scores::fidelity(&values, &found.values, 3, 255.0).expect("pixels").squared_error
        };
        // The noise across a line has two directions of variance 4; below zero it is cut off.
        let refined = error(2, StraightLines::Refined);
        assert!((4.0..8.0).contains(&refined), "{refined}");
        assert!(error(2, StraightLines::Frequent) >= refined);
        assert!(error(1, StraightLines::Refined) > 100.0 * refined);
    }
}
