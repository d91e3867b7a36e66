//! Single sweeps as range images.

use super::ideal_colors;
use geometry::NO_POINT;
use kernels::images::{BORDER, Border, LANES, Planes};
use messages::ClassId;
use random::Random;
use rayon::prelude::*;
use segmentation::ModelInput;
use segmentation::spherical::{Features, N_FEATURES, PolarImage, PolarPixel, features, range_sweeps};
use simulation::Town;
use std::ops::RangeInclusive;
use std::sync::Arc;
use town_sweeps::{Mount, TownDrive};
use training::{Dataset, Example, UNKNOWN};

/// Columns of an image.
const COLUMNS: usize = 1024;
/// Columns that are folded into one column of the network.
pub const FOLD: usize = 4;
/// Rows and columns of the network's input are multiples of this.
const MULTIPLE: usize = 4;
/// Channels of the input without color.
pub const N_INPUTS: usize = FOLD * N_FEATURES;
/// Channels of the input with red, green and blue added.
pub const N_INPUTS_WITH_COLOR: usize = N_INPUTS + FOLD * 3;
/// Share of the training images whose color is removed (section 6.6.1).
const COLOR_DROPOUT: f32 = 0.2;

/// One sweep.
pub struct TownSweep {
    /// The image has no intensities, as in the thesis.
    image: PolarImage,
    /// Class id by pixel; [`UNKNOWN`] where there is no point.
    truth: Vec<u8>,
    /// Color of each pixel, 0 to 1; empty without color.
    colors: Vec<[f32; 3]>,
}

/// Kind of town, and sensors.
#[derive(Clone, Copy)]
pub struct SensorScenario {
    pub town: Town,
    pub mount: Mount,
    pub with_color: bool,
}

impl SensorScenario {
    /// Urban towns, and the HDL-32E of the L3D2 vehicle.
    pub const URBAN: Self = Self { town: Town::Urban, mount: Mount::Rig, with_color: false };
}

/// Simulates `n` sweeps of each drive of 30 s.
pub fn simulate(scenario: SensorScenario, seeds: RangeInclusive<u64>, n: usize) -> anyhow::Result<Vec<TownSweep>> {
    let SensorScenario { town, mount, with_color } = scenario;
    let of_drive = |seed: u64| -> anyhow::Result<Vec<TownSweep>> {
        let drive = TownDrive { town, seed, seconds: 30.0 };
        let simulation = drive.simulation()?;
        let mut of_drive = Vec::new();
        for submap in &drive.submaps_in(&simulation, n, 1, 1, mount)? {
            let cloud = ModelInput::new(&submap.header, &submap.points);
            let heights_m = cloud.ground().heights(cloud.points);
            for sweep in range_sweeps(&cloud, COLUMNS, &heights_m) {
                let class = |&point: &u32| if point == NO_POINT { UNKNOWN } else { submap.truth[point as usize] };
                let truth = sweep.image.nearest.iter().map(class).collect();
                let colors = if with_color { ideal_colors::colors(&simulation, &cloud, &sweep) } else { Vec::new() };
                let image = PolarImage { has_intensity: false, ..sweep.polar };
                of_drive.push(TownSweep { image, truth, colors });
            }
        }
        Ok(of_drive)
    };
    let drives: Vec<anyhow::Result<Vec<TownSweep>>> = seeds.collect::<Vec<_>>().into_par_iter().map(of_drive).collect();
    Ok(drives.into_iter().collect::<anyhow::Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// A data set of sweeps for some classes. Points of other classes are removed.
pub struct SweepDataset {
    sweeps: Arc<Vec<TownSweep>>,
    /// Output number by class id.
    output_of_class: Vec<u8>,
    with_color: bool,
}

impl SweepDataset {
    pub fn new(sweeps: Arc<Vec<TownSweep>>, classes: &[ClassId], with_color: bool) -> Self {
        let output = |class: &ClassId| classes.iter().position(|of| of == class).map_or(UNKNOWN, |i| i as u8);
        Self { sweeps, output_of_class: ClassId::ALL.iter().map(output).collect(), with_color }
    }
}

impl Dataset for SweepDataset {
    fn len(&self) -> usize {
        self.sweeps.len()
    }
    /// An example, rotated at random for training.
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let sweep = &self.sweeps[index];
        let (turn, color_strength) = random
            .map_or((0, 1.0), |random| (random.index(COLUMNS), if random.chance(COLOR_DROPOUT) { 0.0 } else { 1.0 }));
        let output = |&class: &u8| self.output_of_class.get(usize::from(class)).copied().unwrap_or(UNKNOWN);
        let mut truth: Vec<u8> = sweep.truth.iter().map(output).collect();
        let mut image = sweep.image.clone();
        for (pixel, truth) in image.pixels.iter_mut().zip(&truth).filter(|(_, truth)| **truth == UNKNOWN) {
            debug_assert_eq!(*truth, UNKNOWN);
            *pixel = PolarPixel::default();
        }
        image.pixels.chunks_exact_mut(COLUMNS).for_each(|row| row.rotate_left(turn));
        truth.chunks_exact_mut(COLUMNS).for_each(|row| row.rotate_left(turn));
        let mut input = features(&image, &Features::default(), FOLD, MULTIPLE);
        if self.with_color {
            let color = |row: usize, column: usize| {
                let pixel = row * COLUMNS + column;
                let seen = sweep.colors[row * COLUMNS + (column + turn) % COLUMNS];
                if truth[pixel] == UNKNOWN { [0.0; 3] } else { seen.map(|level| color_strength * level) }
            };
            input = with_colors(&input, color);
        }
        Example::new(input, truth)
    }
}

/// Adds three channels per folded column.
fn with_colors(image: &Planes, color: impl Fn(usize, usize) -> [f32; 3]) -> Planes {
    let mut wider = Planes::zeros(N_INPUTS_WITH_COLOR, image.height(), image.width());
    debug_assert!(image.width() >= BORDER);
    for y in 0..image.height() {
        for block in 0..image.n_blocks() {
            wider.row_mut(block, y).copy_from_slice(image.row(block, y));
        }
        for x in 0..image.width() {
            let levels = (0..FOLD).flat_map(|k| color(y, FOLD * x + k));
            for (channel, level) in (N_INPUTS..).zip(levels) {
                wider.row_mut(channel / LANES, y)[x][channel % LANES] = level;
            }
        }
    }
    wider.fill_border(Border::Circular);
    wider
}
