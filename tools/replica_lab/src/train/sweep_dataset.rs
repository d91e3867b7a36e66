//! The data set of a recipe: sweeps of simulated towns and of recordings.

use super::TrainingData;
use super::augmentation::{GroundShape, SparseImage, augment, sparse_view};
use super::bev_labels::bev_labels;
use super::camera_columns::CameraNeeds;
use super::camera_dropout::ImageAugmentation;
use super::intensity_scale::IntensityScale;
use super::labeled_image::{LabeledImage, images_of};
use super::recipe::Recipe;
use super::recipe_data::{Data, Range, RecordingSource};
use super::recorded_sweeps::RecordedSweeps;
use super::removed_classes::RemovedClasses;
use super::sources::{Labeled, simulate};
use super::sweep_file::SweepFile;
use anyhow::ensure;
use kernels::images::Planes;
use random::Random;
use segmentation::intensity::{GroundHistogram, GroundIntensities};
use segmentation::network::NetworkSpec;
use segmentation::spherical::{PolarImage, Settings, features};
use std::path::Path;
use training::{Dataset, Example, NO_CELL, SparseView, UNKNOWN};

/// Range images of sweeps, with the class of every pixel. Memory: the simulated drives of one step, or one submap.
pub struct SweepDataset {
    file: SweepFile,
    sources: Vec<Source>,
    /// Number of pixels of each class.
    counts: Vec<u64>,
    /// Intensities of the ground, and their quantiles when all sources have been read.
    ground: GroundHistogram,
    ground_intensities: Option<GroundIntensities>,
    ground_shape: GroundShape,
    settings: Settings,
    needs: CameraNeeds,
    removed_classes: RemovedClasses,
    augmentation: ImageAugmentation,
    without_intensity: f32,
    has_sparse_views: bool,
    has_bev_labels: bool,
}

/// Sweeps that are used equally often.
struct Source {
    /// Its first sweep in the file.
    first: usize,
    n_sweeps: usize,
    /// Number of examples per epoch.
    n_examples: usize,
}

impl SweepDataset {
    /// A data set without sweeps, which will be kept in a file in `folder`.
    pub fn new(recipe: &Recipe, folder: &Path) -> anyhow::Result<Self> {
        let settings = recipe.settings()?;
        let file = SweepFile::create(folder, settings.columns, settings.features.camera_bands().len())?;
        Ok(Self {
            file,
            sources: Vec::new(),
            counts: vec![0; settings.classes.len()],
            ground: GroundHistogram::default(),
            ground_intensities: None,
            ground_shape: GroundShape::new(&settings.classes),
            needs: CameraNeeds::for_images(&settings.features),
            removed_classes: RemovedClasses::from_names(&recipe.data.removed_classes, &settings.classes)?,
            augmentation: recipe.augmentation,
            without_intensity: recipe.data.without_intensity,
            has_sparse_views: recipe.train.consistency > 0.0,
            has_bev_labels: recipe.train.bev_head > 0.0,
            settings,
        })
    }

    fn push(&mut self, image: &LabeledImage, scale: IntensityScale) -> anyhow::Result<()> {
        for class in image.truth.iter().filter(|class| **class != UNKNOWN) {
            self.counts[usize::from(*class)] += 1;
        }
        if image.image.has_intensity && scale == IntensityScale::Own {
            for pixel in image.image.pixels.iter().filter(|pixel| pixel.is_valid()) {
                self.ground.add(pixel.intensity, pixel.height_m);
            }
        }
        self.file.push(image)
    }

    fn end_source(&mut self, first: usize, weight: f64) {
        let n_sweeps = self.file.len() - first;
        let n_examples = (n_sweeps as f64 * weight).ceil() as usize;
        self.sources.push(Source { first, n_sweeps, n_examples });
    }

    /// Number of sweeps.
    pub fn n_sweeps(&self) -> usize {
        self.file.len()
    }

    #[cfg(test)]
    /// A sweep as it is kept, without random changes.
    pub fn image(&self, sweep: usize) -> PolarImage {
        self.file.image(sweep).expect("the file is open, and of the length that was written").image
    }

    /// The input of the network.
    fn input(&self, image: &PolarImage) -> Planes {
        let multiple_of = NetworkSpec::multiple_of(&self.settings.network)[0];
        features(image, &self.settings.features, self.settings.fold, multiple_of)
    }

    /// The sweep of an example. A source of twice as many examples as sweeps has each sweep twice; one of half as many has one of
    /// each two neighbors, drawn at random in each epoch.
    fn sweep_of(&self, mut index: usize, random: Option<&mut Random>) -> usize {
        for source in &self.sources {
            if index >= source.n_examples {
                index -= source.n_examples;
                continue;
            }
            if source.n_examples == source.n_sweeps {
                return source.first + index;
            }
            let within = f64::from(random.map_or(0.5, Random::unit));
            let share = (index as f64 + within) / source.n_examples as f64;
            return source.first + ((share * source.n_sweeps as f64) as usize).min(source.n_sweeps - 1);
        }
        panic!("an example beyond the last");
    }
}

impl TrainingData for SweepDataset {
    fn add_towns(&mut self, data: &Data, seeds: Range, progress: &mut dyn FnMut(usize, usize)) -> anyhow::Result<()> {
        let first = self.file.len();
        let settings = self.settings.clone();
        let removed_classes = self.removed_classes.clone();
        let needs = self.needs.clone();
        let convert = |of: Labeled<'_>| Ok(images_of(&of, &settings, &removed_classes, IntensityScale::Own));
        let push =
            |images: Vec<LabeledImage>| images.iter().try_for_each(|image| self.push(image, IntensityScale::Own));
        simulate(data, seeds, &needs, convert, push, progress)?;
        self.end_source(first, 1.0);
        Ok(())
    }

    fn add_recording(&mut self, source: &RecordingSource, folder: &Path) -> anyhow::Result<()> {
        let first = self.file.len();
        let mut recording = RecordedSweeps::open(source, folder, &self.needs)?;
        let scale = IntensityScale::for_source(source, &self.ground);
        let mut n_sweeps = 0;
        let mut n_labeled = 0;
        while let Some(submap) = recording.next()? {
            for image in images_of(&submap.labeled(), &self.settings, &self.removed_classes, scale) {
                if n_sweeps % source.every == 0 {
                    let is_labeled = image.truth.iter().any(|class| *class != UNKNOWN);
                    // Data sets label key frames only.
                    if is_labeled {
                        self.push(&image, scale)?;
                    }
                    n_labeled += usize::from(is_labeled);
                }
                n_sweeps += 1;
            }
        }
        ensure!(
            n_labeled > 0,
            "{}: none of its {n_sweeps} sweeps has a point of a class of the recipe",
            folder.join(&source.file).display()
        );
        self.end_source(first, source.weight);
        Ok(())
    }

    fn finish(&mut self) {
        // Without the ground, points near it belong to other objects.
        self.ground_intensities = self.ground.quantiles().filter(|_| !self.removed_classes.has_ground());
    }

    fn size(&self) -> String {
        format!("{} sweeps, {} labelled pixels", self.n_sweeps(), self.counts.iter().sum::<u64>())
    }

    fn counts(&self) -> &[u64] {
        &self.counts
    }

    fn ground_intensities(&self) -> Option<GroundIntensities> {
        self.ground_intensities
    }
}

impl Dataset for SweepDataset {
    fn len(&self) -> usize {
        self.sources.iter().map(|source| source.n_examples).sum()
    }
    fn example(&self, index: usize, mut random: Option<&mut Random>) -> Example {
        let sweep = self.sweep_of(index, random.as_deref_mut());
        let mut of_sweep = self.file.image(sweep).expect("the file is open, and of the length that was written");
        let is_training = random.is_some();
        if let Some(random) = random.as_deref_mut() {
            of_sweep = augment(of_sweep, self.without_intensity, self.ground_intensities, &self.ground_shape, random);
            self.augmentation.apply(&mut of_sweep.image, &self.settings.features.camera_bands(), random);
        }
        let input = self.input(&of_sweep.image);
        let n_pixels = input.height() * of_sweep.image.columns;
        let bev = (self.has_bev_labels && is_training).then(|| {
            let mut labels = bev_labels(&of_sweep, self.settings.classes.len());
            labels.cells.resize(n_pixels, NO_CELL);
            labels
        });
        // Last, so that the random numbers of the other changes are the same without it.
        let sparse_view = random.filter(|_| self.has_sparse_views).map(|random| {
            let SparseImage { image, pixels } = sparse_view(&of_sweep, random);
            SparseView { input: self.input(&image), pixels }
        });
        let mut truth = of_sweep.truth;
        truth.resize(n_pixels, UNKNOWN);
        Example { input, truth, sparse_view, bev }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::test_recordings::{submaps, write_recording};
    use segmentation::ModelInput;
    use town_sweeps::TownSubmap;

    fn recipe(data: &str) -> Recipe {
        let text = format!(
            "[model]\nkind = 'unet'\nwidths = [4, 4]\ncolumns = 512\nfold = 4\nclasses = ['road', 'building', 'vegetation']\n\
             vote_cell_m = 0.2\n[data]\nwithout_intensity = 0.0\n{data}\n[train]\nseed = 1\nepochs = 1\nbatch = 1\n\
             learning_rate = 0.001\npatience = 1\nloss = {{ kind = 'cross_entropy' }}\n"
        );
        toml::from_str(&text).expect("a recipe")
    }

    fn labeled(submap: &TownSubmap) -> Labeled<'_> {
        Labeled { input: ModelInput::new(&submap.header, &submap.points), classes: &submap.truth }
    }

    fn source(weight: f64, every: usize) -> RecordingSource {
        RecordingSource {
            file: "clouds.mcap".into(),
            drive: None,
            predicted_above: None,
            validation: false,
            weight,
            every,
        }
    }

    fn dataset(folder: &Path, source: &RecordingSource) -> SweepDataset {
        let mut data = SweepDataset::new(&recipe(""), folder).expect("a file");
        data.add_recording(source, folder).expect("read");
        data
    }

    #[test]
    fn recording_of_submaps_gives_their_sweeps_and_classes() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let submaps = submaps();
        write_recording(&folder.path().join("clouds.mcap"), &submaps, "imported", &[]);
        let data = dataset(folder.path(), &source(1.0, 1));
        let settings = recipe("").settings().expect("settings");
        let images = submaps
            .iter()
            .flat_map(|submap| images_of(&labeled(submap), &settings, &RemovedClasses::default(), IntensityScale::Own));
        let images: Vec<LabeledImage> = images.collect();
        assert_eq!((data.len(), data.n_sweeps(), images.len()), (6, 6, 6));
        for (index, image) in images.iter().enumerate() {
            assert!(data.example(index, None).truth == image.truth, "sweep {index}");
            assert!(data.file.image(index).expect("read").image == image.image, "sweep {index}");
        }
        let n_pixels: u64 = data.counts().iter().sum();
        assert!(data.counts().iter().all(|n| *n > 100), "{:?}", data.counts());
        let known = |image: &LabeledImage| image.truth.iter().filter(|class| **class != UNKNOWN).count() as u64;
        assert_eq!(n_pixels, images.iter().map(known).sum::<u64>());
        assert_eq!(dataset(folder.path(), &source(1.0, 4)).n_sweeps(), 2, "sweeps 0 and 4");
    }

    #[test]
    fn weight_sets_how_often_sweeps_are_used() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_recording(&folder.path().join("clouds.mcap"), &submaps(), "imported", &[]);
        let twice = dataset(folder.path(), &source(2.0, 1));
        let mut random = Random::new(3);
        let sweeps: Vec<usize> = (0..twice.len()).map(|index| twice.sweep_of(index, Some(&mut random))).collect();
        assert_eq!(sweeps, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]);
        let mut third = dataset(folder.path(), &source(1.0 / 3.0, 1));
        third.add_recording(&source(1.0, 1), folder.path()).expect("read");
        assert_eq!(third.len(), 2 + 6);
        let mut used = [0; 6];
        for _ in 0..60 {
            (0..2).for_each(|index| used[third.sweep_of(index, Some(&mut random))] += 1);
        }
        assert!(used.iter().all(|n| (5..40).contains(n)), "each sweep in some epoch: {used:?}");
        assert_eq!([2, 7].map(|index| third.sweep_of(index, None)), [6, 11], "the second source");
    }

    #[test]
    fn recording_without_truth_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let add = |source: &RecordingSource| {
            let mut data = SweepDataset::new(&recipe(""), folder.path()).expect("a file");
            format!("{:#}", data.add_recording(source, folder.path()).expect_err("is refused"))
        };
        assert!(add(&source(1.0, 1)).contains("clouds.mcap"), "no file");
        write_recording(&folder.path().join("clouds.mcap"), &submaps(), "launch", &[]);
        let error = add(&source(1.0, 1));
        assert!(error.contains("clouds.mcap: its classes are not the truth: `drive` must name"), "{error}");
        let mut unlabeled = submaps();
        for submap in &mut unlabeled {
            submap.truth.fill(0);
        }
        write_recording(&folder.path().join("clouds.mcap"), &unlabeled, "imported", &[]);
        let error = add(&source(1.0, 1));
        assert!(error.contains("none of its 6 sweeps has a point of a class of the recipe"), "{error}");
    }

    #[test]
    fn predicted_classes_count_from_their_score_on() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_recording(&folder.path().join("clouds.mcap"), &submaps(), "launch", &[]);
        let predicted = |above: f32| {
            let source = RecordingSource { predicted_above: Some(above), ..source(1.0, 1) };
            dataset(folder.path(), &source).counts().to_vec()
        };
        // The score of a class is 10 times its id, of 255: road 70, building 10, vegetation 90.
        let [all, few] = [predicted(0.0), predicted(0.3)];
        assert!(all.iter().all(|n| *n > 100), "{all:?}");
        assert_eq!(few, [0, 0, all[2]]);
    }
}
