//! The data set of a recipe: sweeps of simulated towns, with augmentation.

use super::recipe::{Range, Recipe};
use geometry::NO_POINT;
use messages::ClassId;
use random::Random;
use rayon::prelude::*;
use segmentation::network::NetworkSpec;
use segmentation::spherical::{PolarImage, PolarPixel, Settings, features, range_sweeps};
use segmentation::{ModelInput, ground};
use std::sync::atomic::{AtomicUsize, Ordering};
use town_sweeps::{Mount, TownDrive, TownSubmap};
use training::{Dataset, Example, UNKNOWN};

/// Rows of the training images: those of an HDL-32E. The trained networks accept any number of rows.
const ROWS: usize = 32;

/// Range images of sweeps, with the class of every pixel.
pub struct TownDataset {
    sweeps: Vec<(PolarImage, Vec<u8>)>,
    fold: usize,
    row_multiple: usize,
    without_intensity: f32,
}

impl TownDataset {
    /// Simulates the sweeps of these drives. Calls `progress` with the number of finished drives and of all drives.
    pub fn simulate(recipe: &Recipe, seeds: Range, progress: &(dyn Fn(usize, usize) + Sync)) -> anyhow::Result<Self> {
        let settings = recipe.settings()?;
        let towns = recipe.towns()?;
        let seeds: Vec<u64> = seeds.iter().collect();
        let n_done = AtomicUsize::new(0);
        let of_drive = |seed: &u64| -> anyhow::Result<Vec<(PolarImage, Vec<u8>)>> {
            let data = &recipe.data;
            let town = towns[(*seed % towns.len() as u64) as usize];
            let drive = TownDrive { town, seed: *seed, seconds: data.seconds };
            let submaps = drive.submaps(data.submaps, data.sweeps, data.stride, Mount::Random)?;
            let images = submaps.iter().flat_map(|submap| images_of(submap, &settings)).collect();
            progress(1 + n_done.fetch_add(1, Ordering::Relaxed), seeds.len());
            Ok(images)
        };
        let drives: Vec<anyhow::Result<Vec<_>>> = seeds.par_iter().map(of_drive).collect();
        let sweeps = drives.into_iter().collect::<anyhow::Result<Vec<_>>>()?.into_iter().flatten().collect();
        let row_multiple = NetworkSpec::multiple_of(&settings.network)[0];
        Ok(Self { sweeps, fold: settings.fold, row_multiple, without_intensity: recipe.data.without_intensity })
    }
    /// Number of pixels of each class.
    pub fn counts(&self, n_classes: usize) -> Vec<u64> {
        let mut counts = vec![0; n_classes];
        for class in self.sweeps.iter().flat_map(|(_, truth)| truth).filter(|&&class| class != UNKNOWN) {
            counts[usize::from(*class)] += 1;
        }
        counts
    }
}

/// The sweeps of a submap as images, with the output number of the class of each pixel.
fn images_of(submap: &TownSubmap, settings: &Settings) -> Vec<(PolarImage, Vec<u8>)> {
    let cloud = ModelInput { header: &submap.header, points: &submap.points, colors: None };
    let heights_m = ground::heights(&cloud);
    let output = output_of_class(settings);
    let mut random = Random::of_stream(submap.truth.len() as u64, 0);
    let of_sweep = |sweep: segmentation::spherical::RangeSweep| {
        let class = |&shown: &u32| match shown {
            NO_POINT => UNKNOWN,
            point => output[usize::from(submap.truth[sweep.points.start + point as usize])],
        };
        let truth: Vec<u8> = sweep.image.nearest.iter().map(class).collect();
        with_rows(&sweep.polar, &truth, ROWS, &mut random)
    };
    range_sweeps(&cloud, settings.columns, &heights_m).into_iter().map(of_sweep).collect()
}

/// Reduces or extends an image to `rows` rows. Missing rows are empty. Of a denser sensor, a random choice of neighboring rows or
/// of every n-th row is used.
fn with_rows(image: &PolarImage, truth: &[u8], rows: usize, random: &mut Random) -> (PolarImage, Vec<u8>) {
    let step = if image.rows >= 2 * rows && random.chance(0.5) { image.rows / rows } else { 1 };
    let spare = image.rows.saturating_sub((rows - 1) * step + 1);
    let first = random.index(spare + 1);
    let chosen = (0..rows).map(|row| first + row * step).filter(|&row| row < image.rows);
    let range = |row: usize| row * image.columns..(row + 1) * image.columns;
    let n = rows * image.columns;
    let mut pixels: Vec<PolarPixel> = chosen.clone().flat_map(|row| &image.pixels[range(row)]).copied().collect();
    let mut classes: Vec<u8> = chosen.flat_map(|row| &truth[range(row)]).copied().collect();
    pixels.resize(n, PolarPixel::default());
    classes.resize(n, UNKNOWN);
    (PolarImage { rows, pixels, ..*image }, classes)
}

/// Output number of a network by class id; [`UNKNOWN`] for classes that it does not distinguish.
pub fn output_of_class(settings: &Settings) -> Vec<u8> {
    let output = |class: &ClassId| settings.classes.iter().position(|name| name == class.name());
    ClassId::ALL.iter().map(|class| output(class).map_or(UNKNOWN, |output| output as u8)).collect()
}

impl Dataset for TownDataset {
    fn len(&self) -> usize {
        self.sweeps.len()
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let (image, truth) = &self.sweeps[index];
        let (mut image, mut truth) = (image.clone(), truth.clone());
        if let Some(random) = random {
            augment(&mut image, &mut truth, self.without_intensity, random);
        }
        let input = features(&image, self.fold, self.row_multiple);
        truth.resize(input.height() * image.columns, UNKNOWN);
        Example { input, truth }
    }
}

/// Rotates and mirrors a sweep at random, adds noise, and removes returns as a worse sensor would.
fn augment(image: &mut PolarImage, truth: &mut [u8], without_intensity: f32, random: &mut Random) {
    let columns = image.columns;
    let turn = random.index(columns);
    let (mirror, turn_up) = (random.chance(0.5), random.range(-std::f32::consts::PI, std::f32::consts::PI));
    let (sin, cos) = turn_up.sin_cos();
    let range_scale = random.range(0.95, 1.05);
    let height_error_m = 0.04 * random.gauss();
    let noise_m = 0.03 * random.unit();
    let lost = if random.chance(0.3) { 0.3 * random.unit() } else { 0.0 };
    let lost_rows = if random.chance(0.2) { 0.5 * random.unit() } else { 0.0 };
    let gain = random.range(0.7, 1.4);
    if random.chance(without_intensity) {
        image.has_intensity = false;
    }
    for (row, truth) in image.pixels.chunks_exact_mut(columns).zip(truth.chunks_exact_mut(columns)) {
        let row_lost = random.chance(lost_rows);
        row.rotate_left(turn);
        truth.rotate_left(turn);
        if mirror {
            row.reverse();
            truth.reverse();
        }
        for (pixel, truth) in row.iter_mut().zip(truth) {
            if row_lost || !pixel.is_valid() || random.chance(lost) {
                (*pixel, *truth) = (PolarPixel::default(), UNKNOWN);
                continue;
            }
            let [x, y, z] = pixel.ray;
            let y = if mirror { -y } else { y };
            let scale = range_scale + noise_m * random.gauss() / pixel.range_m();
            pixel.ray = [(cos * x - sin * y) * scale, (sin * x + cos * y) * scale, z * scale];
            pixel.height_m = pixel.height_m * range_scale + height_error_m;
            pixel.intensity = (f32::from(pixel.intensity) * gain).min(255.0) as u8;
        }
    }
}
