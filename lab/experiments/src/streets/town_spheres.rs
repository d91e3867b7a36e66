//! Spheres of submaps of urban towns, as points with colors.

use super::street_data::{TEST, VALIDATION};
use crate::task::{DataSets, Examples, Task};
use messages::ClassId;
use random::Random;
use rayon::prelude::*;
use segmentation::ModelInput;
use segmentation::intensity::IntensityMap;
use segmentation::points::{CellCloud, GriddedCells, PointFeature, SphereSettings};
use simulation::{Simulation, Town};
use std::ops::RangeInclusive;
use std::sync::Arc;
use town_sweeps::{IdealCamera, Mount, TownDrive, TownSubmap};
use training::{
    Augmentation, ClassifiedCells, Dataset, DrawnItem, Hierarchy, PointExample, TrainingSpheres, classes_of_cells,
};

/// Training drives, with the same number of submaps each.
const TRAIN: RangeInclusive<u64> = 501..=520;
/// Submaps of a drive.
const N_SUBMAPS: usize = 3;
/// Sweeps of a submap, and revolutions from one to the next.
const SWEEPS: (usize, u64) = (4, 5);
/// Side of the cells whose barycenters are the points, m.
const CELL_M: f32 = 0.3;
/// Radius of the spheres, m (section 6.3.2).
pub const RADIUS_M: f32 = 10.0;
/// Spheres of an epoch (section 6.3.2).
const SPHERES_PER_EPOCH: usize = 100;
/// Largest number of spheres for validation, and for each score.
const MOST_SPHERES: [usize; 2] = [60, 240];

/// Description of the data for recipes.
pub fn description() -> String {
    format!(
        "urban, HDL-32E, points with colors in spheres of {RADIUS_M} m: {N_SUBMAPS} submaps each of drives {TRAIN:?} to learn, \
         {VALIDATION:?} to validate, {TEST:?} to score"
    )
}

/// The features of a point.
pub fn features(with_color: bool) -> Vec<PointFeature> {
    let color = with_color.then_some(PointFeature::ColorHeight);
    [PointFeature::Offset, PointFeature::Height].into_iter().chain(color).collect()
}

/// Simulated submaps with class ids.
pub struct TownClouds {
    train: Vec<ClassifiedCells>,
    validation: Vec<ClassifiedCells>,
    test: Vec<ClassifiedCells>,
}

impl TownClouds {
    pub fn simulate() -> anyhow::Result<Self> {
        Ok(Self { train: clouds(TRAIN)?, validation: clouds(VALIDATION)?, test: clouds(TEST)? })
    }

    /// The task of distinguishing these classes; points of other classes are removed.
    pub fn task(&self, classes: &[ClassId], with_color: bool) -> anyhow::Result<Task> {
        let features = features(with_color);
        let grid = |clouds: &[ClassifiedCells], most| -> anyhow::Result<Box<dyn Dataset<PointExample>>> {
            Ok(Box::new(GridSpheres::new(kept(clouds, classes), features.clone(), most)?))
        };
        let sets = DataSets::<PointExample> {
            train: Box::new(RandomSpheres::new(kept(&self.train, classes), features.clone())),
            validation: grid(&self.validation, MOST_SPHERES[0])?,
            tests: vec![("urban", grid(&self.test, MOST_SPHERES[1])?)],
        };
        Ok(Task { examples: Examples::Points(sets), n_classes: classes.len(), tree: Hierarchy::from_classes(classes) })
    }
}

fn clouds(seeds: RangeInclusive<u64>) -> anyhow::Result<Vec<ClassifiedCells>> {
    let of_drive = |seed: u64| -> anyhow::Result<Vec<ClassifiedCells>> {
        let drive = TownDrive { town: Town::Urban, seed, seconds: 30.0 };
        let simulation = drive.simulation()?;
        let submaps = drive.submaps_in(&simulation, N_SUBMAPS, SWEEPS.0, SWEEPS.1, Mount::Rig)?;
        submaps.iter().map(|submap| town_cloud(&simulation, submap)).collect()
    };
    let drives: Vec<anyhow::Result<Vec<ClassifiedCells>>> =
        seeds.collect::<Vec<_>>().into_par_iter().map(of_drive).collect();
    Ok(drives.into_iter().collect::<anyhow::Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// The cells of a submap: the most frequent class of their points, and the color of the first one.
fn town_cloud(simulation: &Simulation, submap: &TownSubmap) -> anyhow::Result<ClassifiedCells> {
    let input = ModelInput::new(&submap.header, &submap.points);
    let GriddedCells { mut cloud, grid } =
        CellCloud::from_input(&input, &input.ground().heights(input.points), &IntensityMap::Unknown, CELL_M)?;
    let firsts: Vec<usize> = (0..grid.len()).map(|cell| grid.points_of(cell)[0] as usize).collect();
    let levels = IdealCamera::color().values(simulation, &submap.header, &submap.points, &firsts);
    let colors = levels.as_chunks::<3>().0.iter();
    cloud.colors = colors.map(|rgb| if rgb[0].is_nan() { [0.0; 3] } else { *rgb }).collect();
    Ok(ClassifiedCells { cloud, truth: classes_of_cells(&grid, &submap.truth) })
}

/// Points of some classes, with the index of their class.
fn kept(clouds: &[ClassifiedCells], classes: &[ClassId]) -> Arc<[ClassifiedCells]> {
    let output = |class: &u8| classes.iter().position(|of| *of as u8 == *class);
    let of_cloud = |ClassifiedCells { cloud, truth }: &ClassifiedCells| {
        let points: Vec<u32> =
            (0..).zip(truth).filter(|(_, class)| output(class).is_some()).map(|(point, _)| point).collect();
        let truth = truth.iter().filter_map(output).map(|output| output as u8).collect();
        ClassifiedCells { cloud: cloud.around([0.0; 3], &points), truth }
    };
    clouds.iter().map(of_cloud).collect()
}

fn example(ClassifiedCells { cloud, truth }: ClassifiedCells, features: &[PointFeature]) -> PointExample {
    let features = cloud.features(features);
    PointExample { positions: cloud.positions, features, truth }
}

/// Random spheres around points of each class in turn, changed at random.
struct RandomSpheres {
    clouds: Arc<[ClassifiedCells]>,
    features: Vec<PointFeature>,
    /// Clouds by their classes.
    spheres: TrainingSpheres,
    augmentation: Augmentation,
}

impl RandomSpheres {
    fn new(clouds: Arc<[ClassifiedCells]>, features: Vec<PointFeature>) -> Self {
        let mut spheres = TrainingSpheres::default();
        for (number, cloud) in (0..).zip(clouds.iter()) {
            let mut classes = cloud.truth.clone();
            classes.sort_unstable();
            classes.dedup();
            for class in classes {
                spheres.add(class, number, 1.0);
            }
        }
        // Curbs are smaller than the elastic distortions of the thesis.
        let augmentation = Augmentation { elastic: Vec::new(), noise_m: 0.01, scale: 0.05, ..Augmentation::default() };
        Self { clouds, features, spheres, augmentation }
    }
}

impl Dataset<PointExample> for RandomSpheres {
    fn len(&self) -> usize {
        SPHERES_PER_EPOCH
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> PointExample {
        let mut fixed = Random::for_stream(0, index as u64);
        let random = random.unwrap_or(&mut fixed);
        let Some(DrawnItem { class, item: number }) = self.spheres.draw(index, random) else {
            return PointExample { positions: Vec::new(), features: Vec::new(), truth: Vec::new() };
        };
        let of = &self.clouds[number as usize];
        let mut sphere = of.sphere(of.cloud.positions[*random.pick(&of.points_of(class))], RADIUS_M);
        let CellCloud { positions, colors, heights_m, .. } = &mut sphere.cloud;
        let factor = self.augmentation.apply(positions, colors, random);
        for height in heights_m {
            *height *= factor;
        }
        example(sphere, &self.features)
    }
}

/// The spheres of a regular grid. Points in several of them count several times.
struct GridSpheres {
    clouds: Arc<[ClassifiedCells]>,
    features: Vec<PointFeature>,
    /// Cloud and center.
    spheres: Vec<(usize, [f32; 3])>,
}

impl GridSpheres {
    /// At most `most` spheres, evenly distributed over all.
    fn new(clouds: Arc<[ClassifiedCells]>, features: Vec<PointFeature>, most: usize) -> anyhow::Result<Self> {
        let settings = SphereSettings { radius_m: RADIUS_M, overlap_m: RADIUS_M / 3.0 };
        let mut spheres = Vec::new();
        for (number, of) in clouds.iter().enumerate() {
            spheres.extend(settings.centers(&of.cloud.positions)?.into_iter().map(|center| (number, center)));
        }
        let n = spheres.len();
        if n > most {
            spheres = (0..most).map(|i| spheres[i * n / most]).collect();
        }
        Ok(Self { clouds, features, spheres })
    }
}

impl Dataset<PointExample> for GridSpheres {
    fn len(&self) -> usize {
        self.spheres.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> PointExample {
        let (number, center) = self.spheres[index];
        example(self.clouds[number].sphere(center, RADIUS_M), &self.features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::ClassId::{Building, Pole, Road};

    /// A road of 40 x 40 m in steps of 1 m, a pole in its middle, and a building.
    fn town() -> ClassifiedCells {
        let mut cloud = CellCloud::default();
        let mut classes = Vec::new();
        let mut add = |position: [f32; 3], class: ClassId| {
            cloud.positions.push(position);
            cloud.heights_m.push(position[2]);
            cloud.colors.push([class as u8 as f32 / 255.0; 3]);
            classes.push(class as u8);
        };
        (0..1600_u16).for_each(|i| add([f32::from(i % 40), f32::from(i / 40), 0.0], Road));
        (0..4_u8).for_each(|z| add([20.0, 20.0, f32::from(z)], Pole));
        (0..4_u8).for_each(|z| add([0.0, 0.0, f32::from(z)], Building));
        ClassifiedCells { cloud, truth: classes }
    }

    #[test]
    fn removed_classes_are_in_no_sphere() {
        let clouds = kept(&[town()], &[Pole, Road]);
        assert_eq!(clouds[0].truth.len(), 1604);
        let spheres = GridSpheres::new(clouds, features(true), usize::MAX).expect("spheres");
        let mut counts = [0_usize; 2];
        for index in 0..spheres.len() {
            let PointExample { positions, features, truth } = spheres.example(index, None);
            assert_eq!((features.len(), truth.len()), (9 * positions.len(), positions.len()));
            for class in truth {
                counts[usize::from(class)] += 1;
            }
        }
        assert!(counts[0] >= 4 && counts[1] >= 1600, "{counts:?}: all points are in a sphere");
    }

    #[test]
    fn training_spheres_are_around_points_of_each_class_in_turn() {
        let spheres = RandomSpheres::new(kept(&[town()], &[Pole, Road]), features(false));
        for index in 0..6 {
            let of = |seed| spheres.example(index, Some(&mut Random::new(seed)));
            let PointExample { positions, truth, .. } = of(3);
            let center = positions.iter().position(|p| p.iter().all(|v| v.abs() < 0.1)).expect("its center");
            assert_eq!(usize::from(truth[center]), index % 2);
            assert!(of(3).positions == positions && of(4).positions != positions);
        }
    }
}
