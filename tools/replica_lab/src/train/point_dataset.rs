//! The data set of a recipe for networks on points: spheres of submaps of simulated towns and of recordings.

use super::TrainingData;
use super::augmentation::{GroundShape, change_intensities, reshape_ground, shift_heights};
use super::camera_columns::CameraNeeds;
use super::intensity_scale::IntensityScale;
use super::point_recipe::PointRecipe;
use super::recipe_data::{Data, Range, RecordingSource};
use super::recorded_sweeps::RecordedSweeps;
use super::removed_classes::RemovedClasses;
use super::sources::{Labeled, simulate};
use super::submap_file::SubmapFile;
use anyhow::ensure;
use messages::ClassId;
use random::Random;
use segmentation::ModelInput;
use segmentation::intensity::{GroundHistogram, GroundIntensities};
use segmentation::points::{CellCloud, GriddedCells, PointSettings};
use std::path::Path;
use training::{
    Augmentation, ClassifiedCells, Dataset, DrawnItem, PointExample, TrainingSpheres, UNKNOWN, classes_of_cells,
};

/// Spheres of submaps. Memory: the simulated drives of one step, or one submap.
pub struct PointDataset {
    file: SubmapFile,
    /// The submaps by their classes.
    spheres: TrainingSpheres,
    /// Number of points of each class.
    counts: Vec<u64>,
    /// Intensities of the ground.
    ground: GroundHistogram,
    /// Median intensity of the ground, when all submaps are known.
    ground_median: Option<u8>,
    ground_shape: GroundShape,
    settings: PointSettings,
    /// Output number by class id.
    outputs: Vec<u8>,
    needs: CameraNeeds,
    removed_classes: RemovedClasses,
    augmentation: Augmentation,
    without_intensity: f32,
    n_spheres: usize,
    /// Submap and center of the spheres for validation; `None` for training.
    validation: Option<Vec<(usize, [f32; 3])>>,
}

impl PointDataset {
    /// A data set without submaps, which will be kept in a file in `folder`.
    pub fn new(recipe: &PointRecipe, folder: &Path, validation: bool) -> anyhow::Result<Self> {
        let settings = recipe.settings()?;
        let output = |class: &ClassId| settings.classes.iter().position(|name| name == class.name());
        Ok(Self {
            file: SubmapFile::create(folder)?,
            spheres: TrainingSpheres::default(),
            counts: vec![0; settings.classes.len()],
            ground: GroundHistogram::default(),
            ground_median: None,
            ground_shape: GroundShape::new(&settings.classes),
            outputs: ClassId::ALL.iter().map(|class| output(class).map_or(UNKNOWN, |output| output as u8)).collect(),
            needs: CameraNeeds::for_points(&settings.features),
            removed_classes: RemovedClasses::from_names(&recipe.data.removed_classes, &settings.classes)?,
            augmentation: recipe.augmentation.clone(),
            without_intensity: recipe.data.without_intensity,
            n_spheres: if validation { recipe.spheres.validation } else { recipe.spheres.epoch },
            validation: validation.then(Vec::new),
            settings,
        })
    }

    fn push(&mut self, submap: SubmapCells, weight: f64) -> anyhow::Result<()> {
        let SubmapCells { cells: labeled, ground } = submap;
        for class in 0..self.counts.len() {
            let n = labeled.truth.iter().filter(|of| usize::from(**of) == class).count();
            self.counts[class] += n as u64;
            if n > 0 {
                self.spheres.add(class as u8, self.file.len() as u32, weight);
            }
        }
        self.ground.join(&ground);
        if let Some(spheres) = &mut self.validation {
            let centers = self.settings.spheres.centers(&labeled.cloud.positions)?;
            spheres.extend(centers.into_iter().map(|center| (self.file.len(), center)));
        }
        self.file.push(&labeled)
    }

    fn training_sphere(&self, index: usize, random: &mut Random) -> Option<ClassifiedCells> {
        let DrawnItem { class, item: submap } = self.spheres.draw(index, random)?;
        let submap = self.file.submap(submap as usize).expect("the file is open, and of the length that was written");
        let center = submap.cloud.positions[*random.pick(&submap.points_of(class))];
        let mut sphere = submap.sphere(center, self.settings.spheres.radius_m);
        reshape_ground(&mut sphere, &self.ground_shape, random);
        let cloud = &mut sphere.cloud;
        let factor = self.augmentation.apply(&mut cloud.positions, &mut cloud.colors, random);
        cloud.heights_m.iter_mut().for_each(|height| *height *= factor);
        shift_heights(cloud, random);
        if random.chance(self.without_intensity) {
            cloud.intensities.clear();
        } else {
            change_intensities(&mut sphere, self.ground_median, random);
        }
        Some(sphere)
    }
}

/// The cells of a submap, without removed classes.
struct SubmapCells {
    /// Each has the most frequent class of its points.
    cells: ClassifiedCells,
    /// Intensities of the ground.
    ground: GroundHistogram,
}

fn cells_of(
    Labeled { input: whole, classes }: &Labeled<'_>,
    outputs: &[u8],
    removed_classes: &RemovedClasses,
    settings: &PointSettings,
    scale: IntensityScale,
) -> anyhow::Result<SubmapCells> {
    let of_all_m = whole.ground().heights(whole.points);
    let points = removed_classes.kept(whole.points, classes);
    let heights_m = removed_classes.kept(&of_all_m, classes);
    let colors = whole.colors.map(|colors| removed_classes.kept(colors, classes));
    let kept_classes = removed_classes.kept(classes, classes);
    let input = ModelInput { points: &points, colors: colors.as_deref(), spectra: None, ..*whole };
    let GriddedCells { cloud, grid } =
        CellCloud::from_input(&input, &heights_m, &scale.map(whole.points, &of_all_m), settings.cell_m)?;
    let kept_outputs: Vec<u8> = kept_classes.iter().map(|class| outputs[usize::from(*class)]).collect();
    let truth = classes_of_cells(&grid, &kept_outputs);
    let mut ground = GroundHistogram::default();
    if !cloud.intensities.is_empty() && scale == IntensityScale::Own {
        for (point, height_m) in whole.points.iter().zip(&of_all_m) {
            ground.add(point.intensity, *height_m);
        }
    }
    Ok(SubmapCells { cells: ClassifiedCells { cloud, truth }, ground })
}

impl TrainingData for PointDataset {
    fn add_towns(&mut self, data: &Data, seeds: Range, progress: &mut dyn FnMut(usize, usize)) -> anyhow::Result<()> {
        let outputs = self.outputs.clone();
        let settings = self.settings.clone();
        let needs = self.needs.clone();
        let removed_classes = self.removed_classes.clone();
        let convert = |of: Labeled<'_>| cells_of(&of, &outputs, &removed_classes, &settings, IntensityScale::Own);
        simulate(data, seeds, &needs, convert, |cells| self.push(cells, 1.0), progress)
    }

    fn add_recording(&mut self, source: &RecordingSource, folder: &Path) -> anyhow::Result<()> {
        let mut recording = RecordedSweeps::open(source, folder, &self.needs)?;
        let scale = IntensityScale::for_source(source, &self.ground);
        let mut n_submaps = 0;
        let mut n_labeled = 0;
        while let Some(submap) = recording.next()? {
            if n_submaps % source.every == 0 {
                let cells = cells_of(&submap.labeled(), &self.outputs, &self.removed_classes, &self.settings, scale)?;
                // Data sets label key frames only.
                let is_labeled = cells.cells.truth.iter().any(|class| *class != UNKNOWN);
                if is_labeled {
                    self.push(cells, source.weight)?;
                }
                n_labeled += usize::from(is_labeled);
            }
            n_submaps += 1;
        }
        ensure!(
            n_labeled > 0,
            "{}: none of its {n_submaps} submaps has a point of a class of the recipe",
            folder.join(&source.file).display()
        );
        Ok(())
    }

    fn finish(&mut self) {
        self.ground_median = self.ground.quantiles().map(|quantiles| quantiles[quantiles.len() / 2]);
        let wanted = self.n_spheres;
        if let Some(spheres) = &mut self.validation {
            let n = spheres.len();
            if n > wanted {
                *spheres = (0..wanted).map(|i| spheres[i * n / wanted]).collect();
            }
        }
    }

    fn size(&self) -> String {
        format!("{} submaps, {} labelled points", self.file.len(), self.counts.iter().sum::<u64>())
    }

    fn counts(&self) -> &[u64] {
        &self.counts
    }

    fn ground_intensities(&self) -> Option<GroundIntensities> {
        self.ground.quantiles()
    }
}

impl Dataset<PointExample> for PointDataset {
    fn len(&self) -> usize {
        self.validation.as_ref().map_or(self.n_spheres, Vec::len)
    }
    fn example(&self, index: usize, random: Option<&mut Random>) -> PointExample {
        let sphere = match (&self.validation, random) {
            (Some(spheres), _) => {
                let (submap, center) = spheres[index];
                let submap = self.file.submap(submap).expect("the file is open, and of the length that was written");
                Some(submap.sphere(center, self.settings.spheres.radius_m))
            }
            (None, Some(random)) => self.training_sphere(index, random),
            (None, None) => self.training_sphere(index, &mut Random::for_stream(0, index as u64)),
        };
        let Some(ClassifiedCells { cloud, truth }) = sphere else {
            return PointExample { positions: Vec::new(), features: Vec::new(), truth: Vec::new() };
        };
        let features = cloud.features(&self.settings.features);
        PointExample { positions: cloud.positions, features, truth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{Args, run};
    use messages::{SubmapHeader, SubmapPoint};
    use std::path::PathBuf;

    /// A small network; the data are added to it.
    fn recipe_text(data: &str, train: &str) -> String {
        format!(
            "[model]\nkind = 'waffle_iron'\nnetwork = {{ width = 8, depth = 3, neighbors = 4, cell_m = 1.0, low_m = [-5, -5, -5], \
             high_m = [5, 5, 5], convolution = 'depth_wise' }}\nclasses = ['road', 'building', 'pole']\n\
             features = ['offset', 'height', 'intensity']\ncell_m = 0.5\nradius_m = 5.0\n[data]\nwithout_intensity = 0.0\n{data}\n\
             [spheres]\nepoch = 12\nvalidation = 6\n[train]\nseed = 1\nepochs = {train}\nbatch = 2\nlearning_rate = 0.01\n\
             patience = 10\naverage = 0.5\nloss = {{ kind = 'cross_entropy' }}\n"
        )
    }

    fn dataset(folder: &Path, validation: bool) -> PointDataset {
        let recipe: PointRecipe = toml::from_str(&recipe_text("", "1")).expect("a recipe");
        PointDataset::new(&recipe, folder, validation).expect("a file")
    }

    /// A road of 20 x 20 m in steps of 0.25 m; a wall of buildings along x = 0, and points without a class.
    fn street() -> (Vec<SubmapPoint>, Vec<u8>) {
        let at = |x: f32, y: f32, z: f32| SubmapPoint { x, y, z, intensity: 50, ..SubmapPoint::default() };
        let steps = |n: u16| (0..n).map(|i| f32::from(i) * 0.25 + 0.1);
        let road = steps(80).flat_map(|x| steps(80).map(move |y| (at(x, y, 0.1), ClassId::Road)));
        let wall = steps(80).flat_map(|y| steps(16).map(move |z| (at(0.1, y, 1.0 + z), ClassId::Building)));
        let other = steps(40).map(|y| (at(15.0, y, 2.0), ClassId::Vehicles));
        road.chain(wall).chain(other).map(|(point, class)| (point, class as u8)).unzip()
    }

    fn push(data: &mut PointDataset, weight: f64) {
        let (points, classes) = street();
        let header = SubmapHeader::default();
        let of = Labeled { input: ModelInput::new(&header, &points), classes: &classes };
        let cells =
            cells_of(&of, &data.outputs, &data.removed_classes, &data.settings, IntensityScale::Own).expect("cells");
        data.push(cells, weight).expect("written");
        data.finish();
    }

    #[test]
    fn cells_have_the_class_of_their_points() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut data = dataset(folder.path(), false);
        push(&mut data, 1.0);
        let ClassifiedCells { cloud, truth } = data.file.submap(0).expect("read");
        // Each cell of road and wall has four points.
        assert_eq!(data.counts(), [1600, 320, 0]);
        let unknown: Vec<&u8> = truth.iter().filter(|class| **class == UNKNOWN).collect();
        assert_eq!(unknown.len(), 20, "vehicles");
        for (position, class) in cloud.positions.iter().zip(&truth) {
            let expected = match position {
                [x, _, z] if *x > 14.9 && *z > 1.0 => UNKNOWN,
                [.., z] => u8::from(*z > 0.5),
            };
            assert_eq!(*class, expected, "{position:?}");
        }
        assert!(cloud.intensities.iter().all(|intensity| *intensity == 50.0));
        assert_eq!(data.size(), "1 submaps, 1920 labelled points");
    }

    #[test]
    fn training_spheres_have_each_class_in_their_center_and_follow_the_random_numbers() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut data = dataset(folder.path(), false);
        push(&mut data, 1.0);
        data.augmentation = Augmentation { elastic: Vec::new(), noise_m: 0.0, scale: 0.0, ..data.augmentation };
        data.ground_shape = GroundShape::new(&[]);
        assert_eq!(Dataset::len(&data), 12);
        for index in 0..12 {
            let example = |seed: u64| data.example(index, Some(&mut Random::new(seed)));
            let PointExample { positions, features, truth } = example(7);
            let center = positions.iter().position(|p| p.iter().all(|v| v.abs() < 1e-4)).expect("the center");
            assert_eq!(usize::from(truth[center]), index % 2, "sphere {index}");
            assert!(positions.iter().all(|p| p.iter().map(|v| v * v).sum::<f32>() < 25.01));
            assert_eq!((features.len(), truth.len()), (7 * positions.len(), positions.len()));
            assert!(example(7).positions == positions && example(8).positions != positions);
        }
    }

    #[test]
    fn validation_spheres_cover_the_submap_without_random_changes() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut data = dataset(folder.path(), true);
        data.n_spheres = 1000;
        push(&mut data, 1.0);
        let n = Dataset::len(&data);
        let n_points: usize = (0..n).map(|index| data.example(index, None).positions.len()).sum();
        assert!(n > 3 && n_points >= data.file.submap(0).expect("read").truth.len(), "{n} spheres, {n_points} points");
        data.n_spheres = 3;
        data.finish();
        assert_eq!(Dataset::len(&data), 3);
    }

    #[test]
    #[ignore = "long: .ci/run --nightly"]
    fn training_resumed_after_an_epoch_gives_same_files() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = "towns = ['urban']\nseeds = { first = 1, last = 1 }\nvalidation_seeds = { first = 2, last = 2 }\nseconds = 2.0\n\
                    submaps = 1\nsweeps = 1\nstride = 1";
        let recipe = folder.path().join("recipe.toml");
        std::fs::write(&recipe, recipe_text(data, "2")).expect("writes");
        let out = |name: &str| folder.path().join(name);
        let train = |out: PathBuf, stop_after: Option<usize>| {
            run(&Args { recipe: recipe.clone(), out, stop_after, device: segmentation::ComputeDevice::Cpu })
                .expect("trains");
        };
        train(out("whole"), None);
        train(out("cut"), Some(1));
        train(out("cut"), None);
        for file in ["model.safetensors", "checkpoint.safetensors", "curves.csv"] {
            let bytes = |name: &str| std::fs::read(out(name).join(file)).expect("written");
            assert!(bytes("whole") == bytes("cut"), "{file}");
        }
        let curves = std::fs::read_to_string(out("whole").join("curves.csv")).expect("written");
        assert_eq!(curves.lines().count(), 3);
        let model = segmentation::load(&out("whole").join("model.safetensors"), &segmentation::Options::default());
        assert_eq!(model.expect("loads").card().architecture, "points");
    }
}
