//! Straight lines through the origin (Dynamic Color Lines): the baseline of Graph-based Color Lines.
//!
//! The best K lines that alternating assignment and refitting finds: each pixel belongs to the nearest line, each line is the principal
//! axis of its pixels through the origin.

use crate::image::Image;
use crate::projection::Projection;
use nalgebra::{DMatrix, SymmetricEigen};

/// Passes until no pixel changes its line, at most.
const MAX_PASSES: usize = 50;

/// Projects each pixel onto the nearest of up to `n_lines` straight lines through the origin. The first line starts as the principal axis
/// of all pixels, each further one at the pixel farthest from the lines before it.
pub fn project_onto_straight_lines(image: &Image<'_>, n_lines: usize) -> Projection {
    let pixels = image.pixels();
    let pixel = |index: usize| -> Vec<f64> { pixels.bands.iter().map(|band| f64::from(band[index])).collect() };
    let mut lines: Vec<Vec<f64>> = Vec::new();
    let mut line_of = vec![0; pixels.len()];
    for _ in 0..n_lines.max(1) {
        if lines.is_empty() {
            lines.push(principal_axis(image.n_bands(), (0..pixels.len()).map(pixel)));
        } else {
            let residual = |index: usize| nearest(&pixel(index), &lines).1;
            let Some(farthest) = (0..pixels.len()).max_by(|a, b| residual(*a).total_cmp(&residual(*b))) else { break };
            let spectrum = pixel(farthest);
            let norm = dot(&spectrum, &spectrum).sqrt();
            lines.push(spectrum.iter().map(|value| value / norm.max(f64::MIN_POSITIVE)).collect());
        }
        for _ in 0..MAX_PASSES {
            let mut n_changed = 0;
            for (index, of) in line_of.iter_mut().enumerate() {
                let found = nearest(&pixel(index), &lines).0;
                n_changed += usize::from(std::mem::replace(of, found) != found);
            }
            if n_changed == 0 {
                break;
            }
            for (number, line) in lines.iter_mut().enumerate() {
                let own = (0..pixels.len()).filter(|index| line_of[*index] == number);
                *line = principal_axis(image.n_bands(), own.map(pixel));
            }
        }
    }
    let mut projection =
        Projection { values: vec![f32::NAN; image.n_pixels() * image.n_bands()], lines: vec![0; image.n_pixels()] };
    for (index, at) in pixels.at.iter().enumerate() {
        let (spectrum, at) = (pixel(index), *at as usize);
        let (number, _) = nearest(&spectrum, &lines);
        let along = dot(&spectrum, &lines[number]);
        projection.lines[at] = number as u32 + 1;
        for (band, component) in lines[number].iter().enumerate() {
            projection.values[band * image.n_pixels() + at] = (along * component) as f32;
        }
    }
    projection
}

/// The unit vector with the largest sum of squared products with these spectra.
fn principal_axis(n_bands: usize, spectra: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
    let mut products = DMatrix::<f64>::zeros(n_bands, n_bands);
    for spectrum in spectra {
        for i in 0..n_bands {
            for j in 0..=i {
                products[(i, j)] += spectrum[i] * spectrum[j];
            }
        }
    }
    products.fill_upper_triangle_with_lower_triangle();
    let eigen = SymmetricEigen::new(products);
    let largest = eigen.eigenvalues.imax();
    eigen.eigenvectors.column(largest).iter().copied().collect()
}

/// The nearest line of a spectrum, and the squared distance to it.
fn nearest(spectrum: &[f64], lines: &[Vec<f64>]) -> (usize, f64) {
    let square = dot(spectrum, spectrum);
    let distance = |line: &Vec<f64>| square - dot(spectrum, line).powi(2);
    let by_distance = lines.iter().map(distance).enumerate();
    by_distance.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, square))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
