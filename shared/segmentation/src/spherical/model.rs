//! The model: a network between the images of a submap and the votes of its points.

use super::PolarImage;
use super::features::write_features;
use super::nearest_examples::NearestExamples;
use super::range_sweep::{ImageSource, RangeSweep, SweepPoints};
use super::settings::Settings;
use super::softmax::{NO_VOTE, Vote};
use super::sweep_images::{Prepared, SweepImages, VoteBuffers};
use crate::model_file::ModelFile;
use crate::network::{Inference, PooledImage, Weights};
use crate::options::Options;
use crate::refinement::Refinement;
use crate::segmenter::CellSegmenter;
use crate::views::mean_over_views;
use crate::{CellProbabilities, ModelCard, ModelInput, Report, SegmentationError, Segmenter, SubmapProbabilities};
use candle_core::Tensor;
use ground::SubmapGround;
use kernels::images::Border;
use kernels::images::tensors::read_image;
use messages::{ClassId, ClassRow};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// A network on range images.
pub struct SphericalModel {
    card: ModelCard,
    images: SweepImages,
    network: Inference,
    /// Examples that replace the last layer.
    examples: Option<NearestExamples>,
    point_votes: VoteBuffers,
}

/// A model with the weights of its file.
pub struct LoadedModel {
    /// The model.
    pub model: SphericalModel,
    /// The weights.
    pub weights: Weights,
}

impl SphericalModel {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        let settings = Settings::from_file(file)?;
        let weights = Weights::from_file(&settings.network, file)?;
        let nearest = settings.nearest;
        let model = Self::new(file.card.clone(), settings, &weights)?;
        let Some(nearest) = nearest else { return Ok(model) };
        let network = Inference::feature_extractor(model.settings().network.clone(), &weights, Border::Circular)?;
        let examples = NearestExamples::from_file(file, model.settings(), nearest, network.out_channels())?;
        Ok(Self { network, examples: Some(examples), ..model })
    }
    /// Reads a model file of this architecture.
    ///
    /// # Errors
    /// The errors of [`crate::load`].
    pub fn load(path: &std::path::Path) -> Result<LoadedModel, SegmentationError> {
        let file = ModelFile::read(path)?;
        let model = Self::from_file(&file)?;
        let weights = Weights::from_file(&model.settings().network, &file)?;
        Ok(LoadedModel { model, weights })
    }
    /// Creates a model from settings and weights.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn new(card: ModelCard, settings: Settings, weights: &Weights) -> Result<Self, SegmentationError> {
        let images = SweepImages::new(settings)?;
        let network = Inference::new(images.settings().network.clone(), weights, Border::Circular)?;
        Ok(Self { card, images, network, examples: None, point_votes: VoteBuffers::default() })
    }
    /// Sets the options. Points of sweeps that do not go through the network get the votes of their cells.
    ///
    /// # Errors
    /// If the device cannot be used.
    pub fn with_options(mut self, options: Options) -> Result<Self, SegmentationError> {
        self.images = self.images.with_options(options);
        if let Some(device) = options.device.open()? {
            self.network = self.network.on_device(device)?;
        }
        Ok(self)
    }
    /// Settings of the model.
    pub fn settings(&self) -> &Settings {
        self.images.settings()
    }
    /// Number of multiplications and additions for a sweep of a LiDAR with this number of rings.
    pub fn flops(&self, rings: usize) -> usize {
        let [_, height, width] = self.images.input_size(rings);
        self.network.flops(height, width)
    }
    /// The input of the network for a sweep.
    fn input(&self, image: &PolarImage) -> Result<PooledImage<'_>, SegmentationError> {
        let [_, height, width] = self.images.input_size(image.rows);
        self.network.input(height, width, |input| write_features(image, &self.settings().features, input))
    }
    /// Votes of the pixels of an image in raster order from the output of the network. Votes of pixels without a point
    /// are not written.
    fn vote(&self, image: &PolarImage, output: &Tensor, votes: &mut [Vote]) -> Result<(), SegmentationError> {
        read_image(output, self.network.out_channels(), |output| match &self.examples {
            Some(examples) => examples.vote(image, &output, votes),
            None => self.images.softmax(image, output, votes),
        })?;
        Ok(())
    }
    /// Writes the votes of the points of several sweeps.
    fn vote_together(
        &self,
        source: &ImageSource<'_>,
        prepared: &Prepared,
        of_batch: &[SweepPoints],
        votes: &mut [&mut [Vote]],
    ) -> Result<(), SegmentationError> {
        let sweeps: Vec<RangeSweep> = of_batch.par_iter().map(|of| prepared.sweep(source, of)).collect();
        let inputs: Vec<PooledImage<'_>> =
            sweeps.par_iter().map(|sweep| self.input(&sweep.polar)).collect::<Result<_, _>>()?;
        let outputs = self.network.run_batch(&inputs.iter().map(|input| &**input).collect::<Vec<_>>())?;
        sweeps.par_iter().zip(outputs).zip(votes).try_for_each(|((sweep, output), votes)| {
            self.images.vote(sweep, votes, |of_pixels| self.vote(&sweep.polar, &output, of_pixels))
        })
    }
    /// The shares of the classes in the votes of all sweeps.
    fn cells(&self, input: &ModelInput<'_>, prepared: &Prepared) -> Result<CellProbabilities, SegmentationError> {
        let source = self.images.source(input, prepared);
        let sweeps = &prepared.sweeps;
        let batch = self.images.options().batch;
        let mut of_points = self.point_votes.take(input.points.len());
        let mut of_sweeps = votes_of_sweeps(&mut of_points, sweeps.iter().map(|of| &of.points));
        // Parallel over sweeps instead of rows of one sweep, which scales better.
        let batches = sweeps.par_chunks(batch).zip(of_sweeps.par_chunks_mut(batch));
        batches.try_for_each(|(of_batch, votes)| self.vote_together(&source, prepared, of_batch, votes))?;
        let cells = self.images.cells(input, &of_points);
        self.point_votes.give_back(of_points);
        Ok(cells)
    }
}

impl Segmenter for SphericalModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let ground = SubmapGround::find(input.header, input.points);
        let prepared = self.images.prepare(input, ground.clone());
        let cells = match self.images.options().views {
            0 | 1 => self.cells(input, &prepared)?,
            n_views => {
                let [SubmapProbabilities { cells, .. }] = mean_over_views([self], n_views, input, &ground)?;
                cells
            }
        };
        Ok(self.images.decide(input, &prepared, cells, classes))
    }
}

impl CellSegmenter for SphericalModel {
    fn classes(&self) -> &[ClassId] {
        self.images.classes()
    }
    fn refinement(&self) -> Refinement {
        self.images.options().refinement
    }
    fn probabilities(
        &self,
        input: &ModelInput<'_>,
        ground: &Arc<SubmapGround>,
    ) -> Result<SubmapProbabilities, SegmentationError> {
        let prepared = self.images.prepare(input, ground.clone());
        Ok(SubmapProbabilities { cells: self.cells(input, &prepared)?, report: prepared.report() })
    }
}

/// The votes of each sweep; the votes of points between the sweeps become zero.
fn votes_of_sweeps<'a>(
    mut votes: &'a mut [Vote],
    sweeps: impl Iterator<Item = &'a Range<usize>>,
) -> Vec<&'a mut [Vote]> {
    let mut of_sweeps = Vec::new();
    let mut end = 0;
    for points in sweeps {
        let (between, rest) = votes.split_at_mut(points.start - end);
        between.fill(NO_VOTE);
        let (of_sweep, rest) = rest.split_at_mut(points.len());
        of_sweeps.push(of_sweep);
        votes = rest;
        end = points.end;
    }
    votes.fill(NO_VOTE);
    of_sweeps
}
