//! Corrections of classes by mathematical morphology (thesis section 6.3.2).

use super::softmax::Vote;
use super::{PolarImage, PolarPixel};
use geometry::BevGrid;
use ground::SubmapGround;
use messages::ClassId::{self, Building, Pole, Terrain, Vegetation};
use messages::{ClassRow, SubmapPoint};
use morphology::{Connectivity, Labels, connected_components, geodesic_elongations, reconstruct_by_dilation};
use ndarray::Array2;

/// The corrections that are applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each correction is chosen for itself")]
pub struct Refinement {
    /// Thin objects that stand out in the depth image become poles; poles that are not thin lose their class.
    pub poles: bool,
    /// Regions of buildings and vegetation with fewer than 100 pixels get the surrounding class.
    pub small_regions: bool,
    /// In the top view, regions higher than 2.5 m with a geodesic elongation above 20 become buildings.
    pub buildings: bool,
    /// Terrain and unpaved ground become vegetation where the ground is rough, if the model has this class. Not by the thesis.
    pub rough_ground: bool,
}

impl Refinement {
    /// No correction.
    pub const NONE: Self = Self { poles: false, small_regions: false, buildings: false, rough_ground: false };
}

impl Default for Refinement {
    /// Rough ground only: the corrections of the thesis do not improve the shipped model.
    fn default() -> Self {
        Self { rough_ground: true, ..Self::NONE }
    }
}

/// Regions of fewer pixels are small.
const SMALL_PIXELS: usize = 100;
/// An object stands out if it is this much nearer than its surroundings, m.
const NEARER_M: f32 = 1.0;
/// Lower points are ground for poles and buildings, m.
const GROUND_M: f32 = 0.3;
/// Depth of pixels without a point, m: behind all objects.
const NOTHING_M: f32 = 200.0;
/// Classes with which low vegetation is confused. Rings with errors make pavements rough, too.
const SOIL: [ClassId; 2] = [Terrain, ClassId::Ground];
const BUILDING_M: f32 = 2.5;
const BUILDING_ELONGATION: f64 = 20.0;
/// Side of the cells of the top view, m, and their largest number.
const CELL_M: f64 = 0.2;
const MAX_CELLS: usize = 1 << 24;

impl Refinement {
    /// Corrects the votes of a range image: a corrected pixel exchanges the votes of two classes.
    pub(super) fn of_image(self, image: &PolarImage, classes: &[ClassId], votes: &mut [Vote]) {
        let number = |class: ClassId| classes.iter().position(|of| *of == class);
        if let (true, Some(pole)) = (self.poles, number(Pole)) {
            poles(image, pole, votes);
        }
        if self.small_regions {
            small_regions(image, &[number(Building), number(Vegetation)], votes);
        }
    }

    /// Corrects the classes of the points of a submap from their heights above the ground.
    ///
    /// `of_model` are the classes that the model distinguishes.
    pub(crate) fn of_points(
        self,
        points: &[SubmapPoint],
        ground: &SubmapGround,
        of_model: &[ClassId],
        classes: &mut [ClassRow],
    ) {
        if self.buildings {
            buildings(points, &ground.heights_m, classes);
        }
        if self.rough_ground && of_model.contains(&Vegetation) {
            let is_soil = |row: &ClassRow| SOIL.iter().any(|class| *class as u8 == row.class_id);
            for (row, is_rough) in classes.iter_mut().zip(ground.ground.is_rough()) {
                if is_rough && is_soil(row) {
                    row.class_id = Vegetation as u8;
                }
            }
        }
    }
}

/// The class with the most votes, the first of equals.
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
        let (area, elongation) = (structures.area(label) as f64, elongations[label as usize - 1]);
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

/// Numbers of neighboring pixels by class.
type Vote32 = [u32; super::softmax::MAX_CLASSES];

fn buildings(points: &[SubmapPoint], heights_m: &[f32], classes: &mut [ClassRow]) {
    let high = || points.iter().zip(heights_m).filter(|(_, height_m)| **height_m > BUILDING_M);
    let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (point, _) in high() {
        for (k, value) in [f64::from(point.x), f64::from(point.y)].into_iter().enumerate() {
            (min[k], max[k]) = (min[k].min(value), max[k].max(value));
        }
    }
    let Some(grid) = BevGrid::covering_coarsened(min, max, CELL_M, MAX_CELLS) else { return };
    let cell = |point: &SubmapPoint| grid.cell(f64::from(point.x), f64::from(point.y));
    let mut is_high = Array2::from_elem((grid.rows, grid.cols), false);
    high().filter_map(|(point, _)| cell(point)).for_each(|cell| is_high[cell] = true);
    let structures = connected_components(&is_high, Connectivity::Eight);
    let elongations = geodesic_elongations(&structures);
    for ((point, height_m), row) in points.iter().zip(heights_m).zip(classes) {
        let label = cell(point).map_or(0, |cell| structures.image[cell]) as usize;
        if *height_m > GROUND_M && label > 0 && elongations[label - 1] > BUILDING_ELONGATION {
            row.class_id = Building as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::Ground;
    use messages::SubmapHeader;
    use random::Random;

    const CLASSES: [ClassId; 3] = [Building, Vegetation, Pole];

    /// A wall at 9 m that the network classifies as `class` everywhere.
    fn wall(class: usize) -> (PolarImage, Vec<Vote>) {
        let (rows, columns) = (32, 64);
        let pixels = vec![PolarPixel { ray: [9.0, 0.0, 0.0], height_m: 1.0, intensity: 0 }; rows * columns];
        let mut vote = [0; super::super::softmax::MAX_CLASSES];
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
        Refinement { poles: true, ..Refinement::NONE }.of_image(&image, &CLASSES, &mut votes);
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
        Refinement { small_regions: true, ..Refinement::NONE }.of_image(&image, &CLASSES, &mut votes);
        let at = |row: usize| best(&votes[row * 64 + 8]);
        assert_eq!([at(6), at(20), at(29), at(13)], [1, 1, 1, 1], "99, 99 and 36 pixels");

        let (image, mut votes) = wall(1);
        (1..13).for_each(|row| votes[row * 64 + 5..row * 64 + 14].iter_mut().for_each(|vote| vote[0] = 250));
        Refinement { small_regions: true, ..Refinement::NONE }.of_image(&image, &CLASSES, &mut votes);
        assert_eq!(best(&votes[6 * 64 + 8]), 0, "108 pixels stay");
    }

    #[test]
    fn high_and_elongated_region_becomes_building() {
        let point = |x: f32, y: f32, z: f32| SubmapPoint { x, y, z, ..SubmapPoint::default() };
        // A facade of 40 m, and a square of 6 m.
        let mut points: Vec<SubmapPoint> = (0..400).map(|i| point(0.1 * i as f32, 0.0, 4.0)).collect();
        points.extend((0..900).map(|i| point(0.2 * (i % 30) as f32, 20.0 + 0.2 * (i / 30) as f32, 4.0)));
        points.extend([point(10.0, 0.0, 1.0), point(10.0, 0.0, 0.1)]);
        let mut rows = vec![ClassRow { class_id: Vegetation as u8, score: 200 }; points.len()];
        let ground = Ground::find(&SubmapHeader::default(), &points);
        let ground = SubmapGround { ground, heights_m: points.iter().map(|point| point.z).collect() };
        let refinement = Refinement { buildings: true, ..Refinement::NONE };
        refinement.of_points(&points, &ground, &[Building], &mut rows);
        let classes: Vec<u8> = rows.iter().map(|row| row.class_id).collect();
        assert!(classes[..400].iter().all(|class| *class == Building as u8));
        assert!(classes[400..1300].iter().all(|class| *class == Vegetation as u8));
        assert_eq!(classes[1300..], [Building as u8, Vegetation as u8]);
    }

    #[test]
    fn ground_on_rough_terrain_becomes_vegetation() {
        let mut random = Random::new(3);
        let mut point = |i: usize| {
            let (x, y) = (random.range(0.0, 20.0), random.range(-5.0, 5.0));
            let roughness_m = if y > 0.0 { 0.12 } else { 0.01 };
            let class_id = if i.is_multiple_of(2) { Terrain } else { Building } as u8;
            let z = roughness_m * random.gauss();
            (SubmapPoint { x, y, z, ..SubmapPoint::default() }, ClassRow { class_id, score: 200 })
        };
        let (points, before): (Vec<SubmapPoint>, Vec<ClassRow>) = (0..40_000).map(&mut point).unzip();
        let ground = SubmapGround::find(&SubmapHeader::default(), &points);
        let refined = |of_model: &[ClassId]| {
            let mut rows = before.clone();
            Refinement::default().of_points(&points, &ground, of_model, &mut rows);
            rows
        };
        let rows = refined(&[Terrain, Building, Vegetation]);
        let mut n_changed = 0;
        for ((point, before), row) in points.iter().zip(&before).zip(&rows) {
            let is_changed = row != before;
            assert!(!is_changed || row.class_id == Vegetation as u8 && before.class_id == Terrain as u8);
            // The vote of the cells around decides near the border.
            assert!(!is_changed || point.y > -1.0, "{point:?}");
            n_changed += usize::from(is_changed && point.y > 1.0);
        }
        let n_rough = points.iter().zip(&before).filter(|(point, row)| point.y > 1.0 && row.class_id == Terrain as u8);
        assert!(n_changed as f64 > 0.9 * n_rough.count() as f64, "{n_changed}");
        assert!(refined(&[Terrain, Building]) == before, "a model without vegetation");
    }
}
