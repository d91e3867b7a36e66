//! The model: settings, weights, and the classification of a submap.

use super::back_projection::pixel_for;
use super::features::write_features;
use super::range_sweep::{point_ranges, range_sweep};
use super::settings::{Settings, VERSION};
use super::softmax::{NO_VOTE, Softmax, Vote};
use super::votes::Votes;
use super::{Neighbors, Options, PolarImage};
use crate::engine::Border;
use crate::ground;
use crate::model_file::ModelFile;
use crate::network::{Inference, Weights};
use crate::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};
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
    /// Buffer for votes, reused because clearing new memory takes a tenth of the time.
    vote_buffer: Mutex<Vec<Vote>>,
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
            vote_buffer: Mutex::default(),
        })
    }
    /// Replaces the last layer of the network by a classifier of nearest examples. `weights` are those of the model.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn with_neighbors(self, neighbors: Neighbors, weights: &Weights) -> Result<Self, SegmentationError> {
        let network = Inference::of_features(self.settings.network.clone(), weights, Border::Circular)?;
        Ok(Self { network, neighbors: Some(neighbors), ..self })
    }
    /// Sets the options. Points of sweeps that do not go through the network get the votes of their cells.
    #[must_use]
    pub fn with_options(mut self, options: Options) -> Self {
        self.options = Options { every: options.every.max(1), ..options };
        self
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
    /// Votes of the pixels of an image in raster order. Those of pixels without a point are not written.
    fn vote(&self, image: &PolarImage, votes: &mut [Vote]) -> Result<(), SegmentationError> {
        let rows = image.rows.next_multiple_of(self.network.spec().multiple_of()[0]);
        let (fold, n_classes, temperature) = (self.settings.fold, self.classes.len(), self.settings.temperature);
        let input = self.network.input(rows, image.columns / fold, |input| write_features(image, input));
        let result = self.network.run(&input)?;
        match &self.neighbors {
            Some(neighbors) => neighbors.vote(image, &result, votes),
            None => Arch::new().dispatch(Softmax { image, logits: &result, fold, n_classes, temperature, votes }),
        }
        Ok(())
    }
}

impl Segmenter for SphericalModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let heights_m = ground::heights(input);
        let ranges: Vec<_> = point_ranges(input).into_iter().step_by(self.options.every).collect();
        let mut of_points = std::mem::take(&mut *self.vote_buffer.lock().unwrap_or_else(PoisonError::into_inner));
        of_points.resize(input.points.len(), NO_VOTE);
        let of_sweeps = votes_of_sweeps(&mut of_points, ranges.iter().map(|(_, points)| points));
        // One sweep per thread: this scales better than threads inside a network.
        ranges.par_iter().zip(of_sweeps).try_for_each_init(Vec::new, |of_pixels, ((of, points), votes)| {
            let sweep = range_sweep(input, of, points.clone(), self.settings.columns, &heights_m);
            // LiDARs of one vehicle may have different numbers of rings.
            of_pixels.resize(sweep.polar.pixels.len(), NO_VOTE);
            self.vote(&sweep.polar, of_pixels)?;
            self.options.refinement.of_image(&sweep.polar, &self.classes, of_pixels);
            for (point, vote) in votes.iter_mut().enumerate() {
                *vote = pixel_for(&sweep.image, point).map_or(NO_VOTE, |pixel| of_pixels[pixel as usize]);
            }
            Ok::<(), SegmentationError>(())
        })?;
        let decided = Votes { of_points: &of_points }.decide(input.points, self.settings.vote_cell_m);
        *self.vote_buffer.lock().unwrap_or_else(PoisonError::into_inner) = of_points;
        let mut n_unseen = 0;
        for (row, decision) in classes.iter_mut().zip(decided) {
            *row = if let Some((class, share)) = decision {
                ClassRow { class_id: self.classes[class] as u8, score: (share * 255.0).round() as u8 }
            } else {
                n_unseen += 1;
                ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 }
            };
        }
        self.options.refinement.of_points(input.points, &heights_m, classes);
        Ok(Report { n_unseen, coarsened: 1 })
    }
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
