//! The model: settings, weights, and the classification of a submap.

use super::back_projection::pixel_for;
use super::features::write_features;
use super::range_sweep::{ImageSource, PointRange, RangeSweep, point_ranges};
use super::settings::{GroundUse, Settings, VERSION};
use super::softmax::{NO_VOTE, Softmax, Vote};
use super::votes::Votes;
use super::{IntensityMap, Neighbors, Options, PolarImage, Refinement};
use crate::engine::Border;
use crate::engine::tensors::read_image;
use crate::ground::Ground;
use crate::model_file::ModelFile;
use crate::network::{Inference, PooledImage, Weights};
use crate::segmenter::CellSegmenter;
use crate::{CellProbabilities, ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use candle_core::Tensor;
use messages::{ClassId, ClassRow};
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// A network on range images.
pub struct SphericalModel {
    card: ModelCard,
    settings: Settings,
    classes: Vec<ClassId>,
    network: Inference,
    options: Options,
    neighbors: Option<Neighbors>,
    /// Votes of points and of pixels, reused because clearing new memory takes a tenth of the time.
    point_votes: VoteBuffers,
    pixel_votes: VoteBuffers,
}

impl SphericalModel {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        let settings: Settings = file.settings()?;
        settings
            .check()
            .map_err(|error| SegmentationError::Card { path: file.path.clone(), reason: error.to_string() })?;
        let weights = Weights::from_file(&settings.network, file)?;
        Self::new(file.card.clone(), settings, &weights)
    }
    /// Reads a model file of this architecture.
    ///
    /// # Errors
    /// As [`crate::load`].
    pub fn load(path: &std::path::Path) -> Result<(Self, Weights), SegmentationError> {
        let file = ModelFile::read(path)?;
        let model = Self::from_file(&file)?;
        let weights = Weights::from_file(&model.settings.network, &file)?;
        Ok((model, weights))
    }
    /// From settings and weights.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn new(card: ModelCard, settings: Settings, weights: &Weights) -> Result<Self, SegmentationError> {
        let classes = settings.check()?;
        let network = Inference::new(settings.network.clone(), weights, Border::Circular)?;
        Ok(Self {
            card,
            settings,
            classes,
            network,
            options: Options::default(),
            neighbors: None,
            point_votes: VoteBuffers::default(),
            pixel_votes: VoteBuffers::default(),
        })
    }
    /// Replaces the last layer of the network by a classifier of nearest examples. `weights` are those of the model.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn with_neighbors(self, neighbors: Neighbors, weights: &Weights) -> Result<Self, SegmentationError> {
        let network = Inference::of_features(self.settings.network.clone(), weights, Border::Circular)?;
        let options = self.options;
        Self { network, neighbors: Some(neighbors), ..self }.with_options(options)
    }
    /// Sets the options. Points of sweeps that do not go through the network get the votes of their cells.
    ///
    /// # Errors
    /// If the device cannot be used.
    pub fn with_options(mut self, options: Options) -> Result<Self, SegmentationError> {
        self.options = Options { every: options.every.max(1), batch: options.batch.max(1), ..options };
        if let Some(device) = options.device.open()? {
            self.network = self.network.on_device(device)?;
        }
        Ok(self)
    }
    /// Settings of the model.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
    /// Number of multiplications and additions for a sweep of a LiDAR with this number of rings.
    pub fn flops(&self, rings: usize) -> usize {
        let rows = rings.next_multiple_of(self.network.spec().multiple_of()[0]);
        self.network.flops(rows, self.settings.columns / self.settings.fold)
    }
    /// The input of the network for a sweep.
    fn input(&self, image: &PolarImage) -> Result<PooledImage<'_>, SegmentationError> {
        let rows = image.rows.next_multiple_of(self.network.spec().multiple_of()[0]);
        self.network.input(rows, image.columns / self.settings.fold, |input| {
            write_features(image, &self.settings.features, input);
        })
    }
    /// Votes of the pixels of an image in raster order from the output of the network. Those of pixels without a point are not
    /// written.
    fn vote(&self, image: &PolarImage, output: &Tensor, votes: &mut [Vote]) -> Result<(), SegmentationError> {
        let (fold, n_classes, temperature) = (self.settings.fold, self.classes.len(), self.settings.temperature);
        read_image(output, self.network.out_channels(), |output| match &self.neighbors {
            Some(neighbors) => neighbors.vote(image, &output, votes),
            None => Arch::new().dispatch(Softmax { image, logits: output, fold, n_classes, temperature, votes }),
        })?;
        self.options.refinement.of_image(image, &self.classes, votes);
        Ok(())
    }
    /// Writes the votes of the points of some sweeps.
    fn vote_together(
        &self,
        source: &ImageSource<'_>,
        intensities: &IntensityMap,
        ranges: &[PointRange],
        votes: &mut [&mut [Vote]],
    ) -> Result<(), SegmentationError> {
        let sweep = |(of, points): &PointRange| {
            let mut sweep = source.sweep(of, points.clone());
            intensities.apply(&mut sweep.polar);
            sweep
        };
        let sweeps: Vec<RangeSweep> = ranges.par_iter().map(sweep).collect();
        let inputs: Vec<PooledImage<'_>> =
            sweeps.par_iter().map(|sweep| self.input(&sweep.polar)).collect::<Result<_, _>>()?;
        let outputs = self.network.run_batch(&inputs.iter().map(|input| &**input).collect::<Vec<_>>())?;
        sweeps.par_iter().zip(outputs).zip(votes).try_for_each(|((sweep, output), votes)| {
            // LiDARs of one vehicle may have different numbers of rings.
            let mut of_pixels = self.pixel_votes.take(sweep.polar.pixels.len());
            self.vote(&sweep.polar, &output, &mut of_pixels)?;
            for (point, vote) in votes.iter_mut().enumerate() {
                *vote = pixel_for(&sweep.image, point).map_or(NO_VOTE, |pixel| of_pixels[pixel as usize]);
            }
            self.pixel_votes.give_back(of_pixels);
            Ok(())
        })
    }
    /// The classes of the points that have one before the network runs.
    fn given(&self, ground: &Ground, heights_m: &[f32]) -> Option<Vec<ClassRow>> {
        (self.settings.ground == GroundUse::Removed).then(|| ground.classes(heights_m))
    }
    /// The votes of all sweeps, without the points that have a class before.
    fn shares(
        &self,
        input: &ModelInput<'_>,
        heights_m: &[f32],
        given: Option<&[ClassRow]>,
    ) -> Result<(CellProbabilities, Report), SegmentationError> {
        let removed: Option<Vec<bool>> = given.map(|rows| rows.iter().map(|row| is_given(*row)).collect());
        let trained = self.settings.ground_intensities;
        let (intensities, foreign_intensity) =
            IntensityMap::of(self.options.intensity, input.points, heights_m, trained);
        let ranges: Vec<PointRange> = point_ranges(input).into_iter().step_by(self.options.every).collect();
        let mut of_points = self.point_votes.take(input.points.len());
        let mut of_sweeps = votes_of_sweeps(&mut of_points, ranges.iter().map(|(_, points)| points));
        // Sweeps on all threads, not rows of one sweep: this scales better.
        let bands = self.settings.features.camera_bands();
        let source = ImageSource::new(input, self.settings.columns, heights_m);
        let source = source.without(removed.as_deref()).with_camera(&bands);
        let batches = ranges.par_chunks(self.options.batch).zip(of_sweeps.par_chunks_mut(self.options.batch));
        batches.try_for_each(|(ranges, votes)| self.vote_together(&source, &intensities, ranges, votes))?;
        let votes = Votes { of_points: &of_points };
        let shares = votes.shares(input.points, self.settings.vote_cell_m, self.classes.len());
        self.point_votes.give_back(of_points);
        Ok((shares, Report { coarsened: 1, foreign_intensity, ..Report::default() }))
    }
}

/// Buffers of votes for the next submap.
#[derive(Default)]
struct VoteBuffers(Mutex<Vec<Vec<Vote>>>);

impl VoteBuffers {
    /// A buffer with arbitrary votes.
    fn take(&self, len: usize) -> Vec<Vote> {
        let mut votes = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        votes.resize(len, NO_VOTE);
        votes
    }
    fn give_back(&self, votes: Vec<Vote>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(votes);
    }
}

impl Segmenter for SphericalModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let found = Ground::of(input);
        let heights_m = found.heights(input.points);
        let given = self.given(&found, &heights_m);
        let (cells, report) = self.shares(input, &heights_m, given.as_deref())?;
        let mut n_unseen = 0;
        for (point, (row, decision)) in classes.iter_mut().zip(cells.decide(&self.classes)).enumerate() {
            let given = given.as_ref().map(|given| given[point]).filter(|row| is_given(*row));
            *row = given.unwrap_or(decision);
            n_unseen += usize::from(!is_given(*row));
        }
        self.options.refinement.of_points(input.points, (&found, &heights_m), &self.classes, classes);
        Ok(Report { n_unseen, ..report })
    }
}

impl CellSegmenter for SphericalModel {
    fn classes(&self) -> &[ClassId] {
        &self.classes
    }
    fn refinement(&self) -> Refinement {
        self.options.refinement
    }
    fn probabilities(
        &self,
        input: &ModelInput<'_>,
        (ground, heights_m): (&Ground, &[f32]),
    ) -> Result<(CellProbabilities, Report), SegmentationError> {
        self.shares(input, heights_m, self.given(ground, heights_m).as_deref())
    }
}

/// Whether a point has its class before the network runs.
fn is_given(row: ClassRow) -> bool {
    row.class_id != ClassId::Unlabeled as u8
}

/// The votes of each sweep; those of points between the sweeps become zero.
fn votes_of_sweeps<'a>(
    mut votes: &'a mut [Vote],
    sweeps: impl Iterator<Item = &'a Range<usize>>,
) -> Vec<&'a mut [Vote]> {
    let (mut of_sweeps, mut end) = (Vec::new(), 0);
    for points in sweeps {
        let (between, rest) = votes.split_at_mut(points.start - end);
        between.fill(NO_VOTE);
        let (of_sweep, rest) = rest.split_at_mut(points.len());
        of_sweeps.push(of_sweep);
        (votes, end) = (rest, points.end);
    }
    votes.fill(NO_VOTE);
    of_sweeps
}
