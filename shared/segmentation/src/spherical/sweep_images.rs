//! The steps before and after a network on range images: the images of a submap before it, the votes and classes after
//! it.
//!
//! [`SphericalModel`](super::SphericalModel) runs the network of a model file in between,
//! [`SubmapSweeps`](super::SubmapSweeps) any other one.

use super::PolarImage;
use super::back_projection::pixel_for;
use super::image_refinement::refine_votes;
use super::range_sweep::{ImageSource, RangeSweep, SweepPoints, sweeps_with_points};
use super::settings::{GroundUse, Settings};
use super::softmax::{NO_VOTE, Softmax, Vote};
use super::votes::Votes;
use crate::decision::Decision;
use crate::intensity::SubmapIntensities;
use crate::model_file::ModelFile;
use crate::options::Options;
use crate::{CellProbabilities, LidarAboveGround, ModelCard, ModelInput, Report, SegmentationError};
use ground::SubmapGround;
use kernels::images::PlanesRef;
use messages::{ClassId, ClassRow};
use pulp::Arch;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// The settings of a model and the options of a run, without a network.
pub struct SweepImages {
    settings: Settings,
    /// The class of each output of the network.
    classes: Vec<ClassId>,
    options: Options,
    pixel_votes: VoteBuffers,
}

/// Results for a whole submap that are needed before its images.
pub(super) struct Prepared {
    /// The sweeps that go through the network.
    pub(super) sweeps: Vec<SweepPoints>,
    ground: Arc<SubmapGround>,
    /// The ground, if it is removed before the network.
    removed: Option<RemovedGround>,
    intensities: SubmapIntensities,
    lidar: LidarAboveGround,
}

/// The ground points of a submap that are removed before the network.
struct RemovedGround {
    /// Class of each point from the ground model.
    classes: Vec<ClassRow>,
    /// Whether each point is ground.
    is_ground: Vec<bool>,
}

/// Steps before and after the network of a model file, with its card.
pub struct LoadedImages {
    /// Steps before and after the network.
    pub images: SweepImages,
    /// The card of the file.
    pub card: ModelCard,
}

impl SweepImages {
    /// Creates the steps for a model with these settings.
    ///
    /// # Errors
    /// [`SegmentationError::Settings`] with the violated rule.
    pub fn new(settings: Settings) -> Result<Self, SegmentationError> {
        let classes = settings.check()?;
        Ok(Self { settings, classes, options: Options::default(), pixel_votes: VoteBuffers::default() })
    }
    /// Creates the steps for a model file, whose weights are not used.
    ///
    /// # Errors
    /// If the file cannot be read, or has another architecture or invalid settings.
    pub fn load(path: &Path) -> Result<LoadedImages, SegmentationError> {
        let file = ModelFile::read(path)?;
        Ok(LoadedImages { images: Self::new(Settings::from_file(&file)?)?, card: file.card })
    }
    /// Sets the options. Points of sweeps that do not go through the network get the votes of their cells.
    #[must_use]
    pub fn with_options(self, options: Options) -> Self {
        let options = Options { every: options.every.max(1), batch: options.batch.max(1), ..options };
        Self { options, ..self }
    }
    /// Settings of the model.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
    /// The class of each output of the network.
    pub(super) fn classes(&self) -> &[ClassId] {
        &self.classes
    }
    /// Options of the run.
    pub fn options(&self) -> &Options {
        &self.options
    }
    /// Channels, rows and columns of the network's input for a range image with this number of rows. Rows below the
    /// image are zero.
    pub fn input_size(&self, rows: usize) -> [usize; 3] {
        let network = &self.settings.network;
        let rows = rows.next_multiple_of(network.multiple_of()[0]);
        [network.inputs(), rows, self.settings.columns / self.settings.fold]
    }
    /// Finds the scale of the intensities, and the classes of the ground if it is removed before the network.
    pub(super) fn prepare(&self, input: &ModelInput<'_>, ground: Arc<SubmapGround>) -> Prepared {
        let removed = (self.settings.ground == GroundUse::Removed).then(|| {
            let classes = ground.ground.classes(&ground.heights_m);
            let is_ground = classes.iter().map(|row| row.class_id != ClassId::Unlabeled as u8).collect();
            RemovedGround { classes, is_ground }
        });
        let trained = self.settings.ground_intensities;
        let intensities = SubmapIntensities::find(self.options.intensity, input.points, &ground.heights_m, trained);
        let sweeps = sweeps_with_points(input).into_iter().step_by(self.options.every).collect();
        let lidar = LidarAboveGround::find(input.header, input.points, &ground.heights_m);
        Prepared { sweeps, ground, removed, intensities, lidar }
    }
    /// Source of the images of the submap.
    pub(super) fn source<'a>(&self, input: &'a ModelInput<'a>, prepared: &'a Prepared) -> ImageSource<'a> {
        let source = ImageSource::new(input, self.settings.columns, &prepared.ground.heights_m);
        let removed = prepared.removed.as_ref().map(|removed| removed.is_ground.as_slice());
        source.without(removed).with_camera(&self.settings.features.camera_bands())
    }
    /// Votes of the pixels of an image in raster order from the scores of the network. Votes of pixels without a point
    /// are not written.
    pub(super) fn softmax(&self, image: &PolarImage, scores: PlanesRef<'_>, votes: &mut [Vote]) {
        let fold = self.settings.fold;
        let n_classes = self.classes.len();
        let temperature = self.settings.temperature;
        Arch::new().dispatch(Softmax { image, logits: scores, fold, n_classes, temperature, votes });
    }
    /// Writes the votes of the points of a sweep. `of_pixels` writes the votes of the pixels that have a point.
    pub(super) fn vote(
        &self,
        sweep: &RangeSweep,
        votes: &mut [Vote],
        of_pixels: impl FnOnce(&mut [Vote]) -> Result<(), SegmentationError>,
    ) -> Result<(), SegmentationError> {
        // LiDARs of one vehicle may have different numbers of rings.
        let mut pixel_votes = self.pixel_votes.take(sweep.polar.pixels.len());
        of_pixels(&mut pixel_votes)?;
        refine_votes(self.options.refinement, &sweep.polar, &self.classes, &mut pixel_votes);
        for (point, vote) in votes.iter_mut().enumerate() {
            *vote = pixel_for(&sweep.image, point).map_or(NO_VOTE, |pixel| pixel_votes[pixel as usize]);
        }
        self.pixel_votes.give_back(pixel_votes);
        Ok(())
    }
    /// The shares of the classes in the votes of all points, per cell.
    pub(super) fn cells(&self, input: &ModelInput<'_>, votes: &[Vote]) -> CellProbabilities {
        Votes { of_points: votes }.shares(input.points, self.settings.vote_cell_m, self.classes.len())
    }
    /// Writes the class of each point.
    pub(super) fn decide(
        &self,
        input: &ModelInput<'_>,
        prepared: &Prepared,
        cells: CellProbabilities,
        classes: &mut [ClassRow],
    ) -> Report {
        let given = |point: usize| {
            let removed = prepared.removed.as_ref()?;
            removed.is_ground[point].then(|| removed.classes[point])
        };
        let decision = Decision { of_model: &self.classes, refinement: self.options.refinement };
        let n_unseen = decision.write(input, &prepared.ground, cells, given, classes);
        Report { n_unseen, ..prepared.report() }
    }
}

impl Prepared {
    /// The report of a submap whose points all have a class.
    pub(super) fn report(&self) -> Report {
        Report { coarsened: 1, foreign_intensity: self.intensities.foreign, lidar: self.lidar, ..Report::default() }
    }
    /// The range image of a sweep.
    pub(super) fn sweep(&self, source: &ImageSource<'_>, of: &SweepPoints) -> RangeSweep {
        let mut sweep = source.sweep(of);
        sweep.polar.apply_intensities(&self.intensities.map);
        sweep
    }
}

/// Buffers of votes for the next submap: clearing new memory takes a tenth of the time.
#[derive(Default)]
pub(super) struct VoteBuffers(Mutex<Vec<Vec<Vote>>>);

impl VoteBuffers {
    /// A buffer with arbitrary votes.
    pub(super) fn take(&self, len: usize) -> Vec<Vote> {
        let mut votes = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        votes.resize(len, NO_VOTE);
        votes
    }
    pub(super) fn give_back(&self, votes: Vec<Vote>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(votes);
    }
}
