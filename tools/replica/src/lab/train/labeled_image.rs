//! Sweeps of labeled submaps as images.

use super::removed_classes::RemovedClasses;
use super::sources::Labeled;
use geometry::NO_POINT;
use messages::{ClassId, ClassRow};
use random::Random;
use segmentation::ground;
use segmentation::spherical::{GroundUse, ImageSource, PolarImage, PolarPixel, RangeSweep, Settings};
use training::UNKNOWN;

/// Rows of the training images: those of an HDL-32E. The trained networks accept any number of rows.
pub const ROWS: usize = 32;

/// A sweep as an image, with the output number of the class of each pixel, [`UNKNOWN`] without one.
pub struct LabeledImage {
    pub image: PolarImage,
    pub truth: Vec<u8>,
}

/// The sweeps of a submap as images of [`ROWS`] rows, without the points of removed classes.
pub fn images_of(
    Labeled { input: cloud, classes }: &Labeled<'_>,
    settings: &Settings,
    removed_classes: &RemovedClasses,
) -> Vec<LabeledImage> {
    let (heights_m, removed) = match settings.ground {
        GroundUse::Kept => (ground::heights(cloud), None),
        GroundUse::Removed => {
            let (heights_m, rows) = ground::heights_and_ground(cloud);
            let is_ground = |row: &ClassRow| row.class_id != ClassId::Unlabeled as u8;
            (heights_m, Some(rows.iter().map(is_ground).collect::<Vec<bool>>()))
        }
    };
    let removed = removed_classes.with_points(removed, classes);
    let output = output_of_class(settings);
    let mut random = Random::of_stream(classes.len() as u64, 0);
    let of_sweep = |sweep: RangeSweep| {
        let class = |&shown: &u32| match shown {
            NO_POINT => UNKNOWN,
            point => output[usize::from(classes[sweep.points.start + point as usize])],
        };
        let truth: Vec<u8> = sweep.image.nearest.iter().map(class).collect();
        with_rows(&sweep.polar, &truth, ROWS, &mut random)
    };
    let bands = settings.features.camera_bands();
    let source = ImageSource::new(cloud, settings.columns, &heights_m).without(removed.as_deref()).with_camera(&bands);
    source.sweeps().into_iter().map(of_sweep).collect()
}

/// Reduces or extends an image to `rows` rows. Missing rows are empty. Of a denser sensor, a random choice of neighboring rows or
/// of every n-th row is used.
fn with_rows(image: &PolarImage, truth: &[u8], rows: usize, random: &mut Random) -> LabeledImage {
    let step = if image.rows >= 2 * rows && random.chance(0.5) { image.rows / rows } else { 1 };
    let spare = image.rows.saturating_sub((rows - 1) * step + 1);
    let first = random.index(spare + 1);
    let chosen = (0..rows).map(|row| first + row * step).filter(|&row| row < image.rows);
    let range = |row: usize| row * image.columns..(row + 1) * image.columns;
    let n = rows * image.columns;
    let mut pixels: Vec<PolarPixel> = chosen.clone().flat_map(|row| &image.pixels[range(row)]).copied().collect();
    let mut classes: Vec<u8> = chosen.clone().flat_map(|row| &truth[range(row)]).copied().collect();
    let n_bands = image.n_camera_bands();
    let of_bands = |row: usize| &image.camera[range(row).start * n_bands..range(row).end * n_bands];
    let mut camera: Vec<f32> = chosen.flat_map(of_bands).copied().collect();
    pixels.resize(n, PolarPixel::default());
    classes.resize(n, UNKNOWN);
    camera.resize(n * n_bands, f32::NAN);
    let (columns, has_intensity) = (image.columns, image.has_intensity);
    LabeledImage { image: PolarImage { rows, columns, pixels, has_intensity, camera }, truth: classes }
}

/// Output number of a network by class id; [`UNKNOWN`] for classes that it does not distinguish.
fn output_of_class(settings: &Settings) -> Vec<u8> {
    let output = |class: &ClassId| settings.classes.iter().position(|name| name == class.name());
    ClassId::ALL.iter().map(|class| output(class).map_or(UNKNOWN, |output| output as u8)).collect()
}
