//! Corrections of the votes of range images by mathematical morphology (thesis section 6.3.2).

use super::polar_image::{PolarImage, PolarPixel};
use super::softmax::{MAX_CLASSES, Vote};
use crate::refinement::{GROUND_M, Refinement};
use messages::ClassId::{self, Building, Pole, Vegetation};
use morphology::{Connectivity, Labels, connected_components, geodesic_elongations, reconstruct_by_dilation};
use ndarray::Array2;

/// Regions with fewer pixels are small.
const SMALL_PIXELS: usize = 100;
/// An object stands out if it is nearer than its surroundings by this much, m.
const NEARER_M: f32 = 1.0;
/// Depth of pixels without a point, m: behind all objects.
const NOTHING_M: f32 = 200.0;

/// Corrects the votes of a range image: a corrected pixel exchanges the votes of two classes.
pub(super) fn refine_votes(refinement: Refinement, image: &PolarImage, classes: &[ClassId], votes: &mut [Vote]) {
    let number = |class: ClassId| classes.iter().position(|of| *of == class);
    if let (true, Some(pole)) = (refinement.poles, number(Pole)) {
        poles(image, pole, votes);
    }
    if refinement.small_regions {
        small_regions(image, &[number(Building), number(Vegetation)], votes);
    }
}

/// The class with the most votes, the first of equal ones.
fn best(vote: &Vote) -> usize {
    (0..vote.len()).rev().max_by_key(|&class| vote[class]).unwrap_or(0)
}

/// The best class of every pixel; `usize::MAX` without a point.
fn best_of_pixels(image: &PolarImage, votes: &[Vote]) -> Array2<usize> {
    let class = |(pixel, vote): (&PolarPixel, &Vote)| if pixel.is_valid() { best(vote) } else { usize::MAX };
    let classes = image.pixels.iter().zip(votes).map(class).collect();
    Array2::from_shape_vec((image.rows, image.columns), classes).expect("one class for every pixel")
}

fn poles(image: &PolarImage, pole: usize, votes: &mut [Vote]) {
    let closeness = |pixel: &PolarPixel| {
        let is_object = pixel.is_valid() && pixel.height_m > GROUND_M;
        if is_object { -pixel.range_m() } else { -NOTHING_M }
    };
    let closeness = image.pixels.iter().map(closeness).collect();
    let closeness = Array2::from_shape_vec((image.rows, image.columns), closeness).expect("one for every pixel");
    let lowered = closeness.mapv(|value| value - NEARER_M);
    let base = reconstruct_by_dilation(&lowered, &closeness, Connectivity::Eight);
    let classes = best_of_pixels(image, votes);
    let mut candidates = ndarray::Zip::from(&closeness).and(&base).map_collect(|value, base| value > base);
    candidates.zip_mut_with(&classes, |candidate, &class| *candidate |= class == pole);
    let structures = connected_components(&candidates, Connectivity::Eight);
    let elongations = geodesic_elongations(&structures);
    let is_thin = |label: u32| {
        let area = structures.area(label) as f64;
        let elongation = elongations[label as usize - 1];
        let length = (4.0 * area * elongation / std::f64::consts::PI).sqrt();
        elongation > area / length
    };
    for ((&label, &class), vote) in
        structures.image.iter().zip(&classes).zip(votes).filter(|((label, _), _)| **label > 0)
    {
        if is_thin(label) {
            vote.swap(pole, class);
        } else if class == pole {
            let mut others = *vote;
            others[pole] = 0;
            vote.swap(pole, best(&others));
        }
    }
}

fn small_regions(image: &PolarImage, of: &[Option<usize>], votes: &mut [Vote]) {
    let classes = best_of_pixels(image, votes);
    let regions: Vec<Labels> = of
        .iter()
        .flatten()
        .map(|class| connected_components(&classes.mapv(|of_pixel| of_pixel == *class), Connectivity::Eight))
        .collect();
    let small_region = |at: [usize; 2]| {
        let mut labels = regions.iter().enumerate().map(|(n, regions)| (n, regions, regions.image[at]));
        let found = labels.find(|(_, regions, label)| *label > 0 && regions.area(*label) < SMALL_PIXELS);
        found.map(|(n, _, label)| (n, label as usize - 1))
    };
    let mut around: Vec<Vec<Vote32>> = regions.iter().map(|regions| vec![Vote32::default(); regions.n()]).collect();
    for row in 0..image.rows {
        for column in 0..image.columns {
            let Some((n, region)) = small_region([row, column]) else { continue };
            for other_row in row.saturating_sub(1)..(row + 2).min(image.rows) {
                for step in [image.columns - 1, 0, 1] {
                    let at = [other_row, (column + step) % image.columns];
                    if classes[at] != usize::MAX && small_region(at).is_none() {
                        around[n][region][classes[at]] += 1;
                    }
                }
            }
        }
    }
    for row in 0..image.rows {
        for column in 0..image.columns {
            let Some((n, region)) = small_region([row, column]) else { continue };
            let around = &around[n][region];
            let most = (0..around.len()).rev().max_by_key(|&class| around[class]).filter(|&class| around[class] > 0);
            if let Some(class) = most {
                votes[row * image.columns + column].swap(classes[[row, column]], class);
            }
        }
    }
}

/// Number of neighboring pixels per class.
type Vote32 = [u32; MAX_CLASSES];

#[cfg(test)]
mod tests {
    use super::*;

    const CLASSES: [ClassId; 3] = [Building, Vegetation, Pole];

    /// A wall at 9 m that the network classifies as `class` everywhere.
    fn wall(class: usize) -> (PolarImage, Vec<Vote>) {
        let rows = 32;
        let columns = 64;
        let pixels = vec![PolarPixel { ray: [9.0, 0.0, 0.0], height_m: 1.0, intensity: 0 }; rows * columns];
        let mut vote = [0; MAX_CLASSES];
        vote[class] = 200;
        (PolarImage { rows, columns, pixels, has_intensity: false, camera: Vec::new() }, vec![vote; rows * columns])
    }

    #[test]
    fn thin_object_becomes_pole_and_wide_object_does_not() {
        let (mut image, mut votes) = wall(0);
        for row in 4..30 {
            image.pixels[row * 64 + 10].ray = [5.0, 0.0, 0.0];
            // As near, but as wide as high.
            (30..56).for_each(|column| image.pixels[row * 64 + column].ray = [5.0, 0.0, 0.0]);
        }
        // A square that the network classified as pole.
        (4..12).for_each(|row| votes[row * 64 + 20..row * 64 + 28].iter_mut().for_each(|vote| vote[2] = 250));
        refine_votes(Refinement { poles: true, ..Refinement::NONE }, &image, &CLASSES, &mut votes);
        let at = |row: usize, column: usize| best(&votes[row * 64 + column]);
        assert_eq!([at(16, 10), at(16, 40), at(8, 24), at(16, 12)], [2, 0, 0, 0]);
    }

    #[test]
    fn small_region_gets_surrounding_class() {
        let (image, mut votes) = wall(1);
        let mut paint = |rows: std::ops::Range<usize>| {
            rows.for_each(|row| votes[row * 64 + 5..row * 64 + 14].iter_mut().for_each(|vote| vote[0] = 250));
        };
        paint(1..12);
        paint(14..25);
        paint(27..31);
        refine_votes(Refinement { small_regions: true, ..Refinement::NONE }, &image, &CLASSES, &mut votes);
        let at = |row: usize| best(&votes[row * 64 + 8]);
        assert_eq!([at(6), at(20), at(29), at(13)], [1, 1, 1, 1], "99, 99 and 36 pixels");

        let (image, mut votes) = wall(1);
        (1..13).for_each(|row| votes[row * 64 + 5..row * 64 + 14].iter_mut().for_each(|vote| vote[0] = 250));
        refine_votes(Refinement { small_regions: true, ..Refinement::NONE }, &image, &CLASSES, &mut votes);
        assert_eq!(best(&votes[6 * 64 + 8]), 0, "108 pixels stay");
    }
}
