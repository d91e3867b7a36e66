//! Tables 5.6 and 5.7: top views of simulated towns, in a low slice (buildings and vehicles) and a high slice (buildings and
//! vegetation). As in the thesis the ground is removed first (by ground segmentation, not by ground truth), and poles count as
//! background.

use crate::experiment::{Experiment, Results};
use crate::loss_table::{loss, table_of_losses};
use crate::recipe::{Recipe, settings, unet};
use crate::task::{DataSets, Examples, Task};
use kernels::images::{Border, Planes};
use messages::ClassId;
use random::Random;
use segmentation::ModelInput;
use simulation::Town;
use std::ops::RangeInclusive;
use town_sweeps::{Mount, TownDrive, TownSubmap};
use training::{Dataset, Example, Hierarchy};

/// A range of heights above the ground, m, and the classes to distinguish in it.
#[derive(Clone, Copy)]
pub struct HeightSlice {
    name: &'static str,
    from_m: f32,
    to_m: f32,
    classes: [ClassId; 2],
    /// Number of features: 2 for lowest and highest point of a pixel; 3 also for their difference.
    n_features: usize,
}

/// The low slice of section 5.6.3.
pub const LOW: HeightSlice = HeightSlice {
    name: "slice-low",
    from_m: 0.3,
    to_m: 2.5,
    classes: [ClassId::Building, ClassId::Vehicles],
    n_features: 2,
};
/// The high slice of section 5.6.3.
pub const HIGH: HeightSlice = HeightSlice {
    name: "slice-high",
    from_m: 2.5,
    to_m: 30.0,
    classes: [ClassId::Building, ClassId::Vegetation],
    n_features: 3,
};

/// Pixels per side, and their size, m: 51 m around the vehicle.
const SIDE: usize = 128;
const PIXEL_M: f32 = 0.4;
/// Unit of the heights in the input, m.
const HEIGHT_M: f32 = 5.0;

const TRAIN: RangeInclusive<u64> = 401..=412;
const VALIDATION: RangeInclusive<u64> = 2001..=2003;
/// Drives that are not used for training or validation. Other experiments have also used these drives.
const TEST: RangeInclusive<u64> = 9401..=9408;

#[derive(Clone, Copy)]
struct Pixel {
    lowest_m: f32,
    highest_m: f32,
    /// Number of points of other classes, and of each class.
    counts: [u32; 3],
}

/// The top view of a submap.
struct TopView {
    pixels: Vec<Pixel>,
}

/// A data set of top views.
struct TopViews {
    views: Vec<TopView>,
    n_features: usize,
}

impl TopView {
    fn new(submap: &TownSubmap, slice: &HeightSlice) -> Self {
        let cloud = ModelInput::new(&submap.header, &submap.points);
        let heights_m = cloud.ground().heights(cloud.points);
        let empty = Pixel { lowest_m: f32::INFINITY, highest_m: 0.0, counts: [0; 3] };
        let mut pixels = vec![empty; SIDE * SIDE];
        for ((point, &height_m), &class) in submap.points.iter().zip(&heights_m).zip(&submap.truth) {
            let [column, row] = [point.x, point.y].map(|v| v / PIXEL_M + 0.5 * SIDE as f32);
            let inside = |v: f32| (0.0..SIDE as f32).contains(&v);
            if !(inside(column) && inside(row) && (slice.from_m..slice.to_m).contains(&height_m)) {
                continue;
            }
            let pixel = &mut pixels[row as usize * SIDE + column as usize];
            pixel.lowest_m = pixel.lowest_m.min(height_m);
            pixel.highest_m = pixel.highest_m.max(height_m);
            pixel.counts[slice.classes.iter().position(|of| *of as u8 == class).map_or(0, |i| i + 1)] += 1;
        }
        Self { pixels }
    }
}

impl Dataset for TopViews {
    fn len(&self) -> usize {
        self.views.len()
    }
    /// An example, mirrored at random for training.
    fn example(&self, index: usize, random: Option<&mut Random>) -> Example {
        let [mirror_x, mirror_y] = random.map_or([false; 2], |random| [random.chance(0.5), random.chance(0.5)]);
        let pixels = &self.views[index].pixels;
        let mut input = Planes::zeros(self.n_features, SIDE, SIDE);
        let mut truth = Vec::with_capacity(SIDE * SIDE);
        for y in 0..SIDE {
            let row = if mirror_y { SIDE - 1 - y } else { y };
            for (x, out) in input.row_mut(0, y).iter_mut().enumerate() {
                let column = if mirror_x { SIDE - 1 - x } else { x };
                let Pixel { lowest_m, highest_m, counts } = pixels[row * SIDE + column];
                if counts == [0; 3] {
                    truth.push(0);
                    continue;
                }
                let features = [lowest_m, highest_m, highest_m - lowest_m];
                for (out, feature) in out.iter_mut().zip(&features[..self.n_features]) {
                    *out = feature / HEIGHT_M;
                }
                // The class with most points; the first one if several have the same number.
                truth.push((0..3_u8).rev().max_by_key(|&class| counts[usize::from(class)]).unwrap_or(0));
            }
        }
        Example::new(input, truth)
    }
}

/// Three submaps of each drive, each of three sweeps 0.5 s apart.
fn top_views(seeds: RangeInclusive<u64>, slice: &HeightSlice) -> anyhow::Result<TopViews> {
    let mut views = Vec::new();
    for seed in seeds {
        let drive = TownDrive { town: Town::Urban, seed, seconds: 30.0 };
        let submaps = drive.submaps(3, 3, 5, Mount::Rig)?;
        views.extend(submaps.iter().map(|submap| TopView::new(submap, slice)));
    }
    Ok(TopViews { views, n_features: slice.n_features })
}

/// Rows of the tables.
const LOSSES: [&str; 6] = ["CE", "focal", "Dice", "Jac. 1", "Jac. 1.5", "Jac. 2"];

impl Experiment for HeightSlice {
    fn name(&self) -> &'static str {
        self.name
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let recipe = |(seed, row): (u64, &str)| Recipe {
            row: row.to_owned(),
            column: self.name.replace('-', " "),
            data: format!(
                "top views of urban drives {TRAIN:?} to learn, {VALIDATION:?} to validate, {TEST:?} to score"
            ),
            network: unet(self.n_features, 3, 8),
            frozen: Vec::new(),
            start: None,
            tree_of: None,
            settings: settings(2, 2e-3, loss(row), seed),
        };
        (0..n_seeds).flat_map(|seed| LOSSES.map(|row| (seed, row))).map(recipe).collect()
    }
    fn load(&self, _: &Recipe) -> anyhow::Result<Task> {
        let sets = DataSets::<Example> {
            train: Box::new(top_views(TRAIN, self)?),
            validation: Box::new(top_views(VALIDATION, self)?),
            tests: vec![("urban", Box::new(top_views(TEST, self)?))],
        };
        let examples = Examples::Images { sets, fold: 1, border: Border::Zero };
        Ok(Task { examples, n_classes: 3, tree: Hierarchy::new(vec![0; 3]) })
    }
    /// An estimate from the number of pixels.
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        30.0
    }
    fn table(&self, results: &Results) -> String {
        table_of_losses(results)
    }
}
