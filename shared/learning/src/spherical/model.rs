//! The model: settings and weights from a file, and what it makes of a submap.

use super::back_projection::pixel_for;
use super::softmax::{MAX_CLASSES, Softmax};
use super::sweeps::{Sweep, point_ranges, sweep};
use super::votes::Votes;
use super::{N_FEATURES, PolarImage, features};
use crate::engine::Border;
use crate::ground;
use crate::model_file::{self, ModelFile};
use crate::network::{Inference, NetworkSpec, Weights};
use crate::{Cloud, LearningError, ModelCard, Report, Segmenter};
use messages::{ClassId, ClassRow};
use pulp::Arch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "spherical";

/// Version that this program writes and runs.
pub const VERSION: u32 = 1;

/// What a model file says beside its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The network. Its inputs are `fold` times the features, its outputs `fold` times the classes.
    pub network: NetworkSpec,
    /// Columns of a sweep's image, 64 to 8192.
    pub columns: usize,
    /// Neighboring columns that the network sees as one pixel, 1 to 16.
    pub fold: usize,
    /// Names of the classes by output.
    pub classes: Vec<String>,
    /// Side of the cells in which sweeps vote, m, 0.02 to 5.
    pub vote_cell_m: f32,
    /// What logits are divided by so that scores are the share of right answers, 0.1 to 10.
    pub temperature: f32,
}

impl Settings {
    /// The class of every output.
    ///
    /// # Errors
    /// The rule that is broken.
    pub fn check(&self) -> Result<Vec<ClassId>, String> {
        let classes: Option<Vec<ClassId>> = self.classes.iter().map(|name| ClassId::from_name(name)).collect();
        let classes = classes.ok_or_else(|| format!("classes {:?} are not all of the table", self.classes))?;
        if let Some(problem) = self.network.problem() {
            return Err(format!("network: {problem}"));
        }
        let (inputs, outputs, _) = self.network.channels();
        let [rows, columns] = self.network.multiple_of();
        let rules = [
            ((64..=8192).contains(&self.columns), format!("columns = {}, must be 64 to 8192", self.columns)),
            ((1..=16).contains(&self.fold), format!("fold = {}, must be 1 to 16", self.fold)),
            (
                self.columns.is_multiple_of(self.fold.max(1) * columns),
                format!("columns = {}, must be a multiple of fold x {columns}", self.columns),
            ),
            (
                (1..=MAX_CLASSES).contains(&classes.len()),
                format!("{} classes, must be 1 to {MAX_CLASSES}", classes.len()),
            ),
            (rows <= 64, format!("the network needs multiples of {rows} rows, at most 64 are possible")),
            (
                inputs == self.fold * N_FEATURES,
                format!("network.inputs = {inputs}, must be fold x {N_FEATURES} features"),
            ),
            (
                outputs == self.fold * classes.len(),
                format!("network.outputs = {outputs}, must be fold x {} classes", classes.len()),
            ),
            (
                (0.02..=5.0).contains(&self.vote_cell_m),
                format!("vote_cell_m = {}, must be 0.02 to 5", self.vote_cell_m),
            ),
            (
                (0.1..=10.0).contains(&self.temperature),
                format!("temperature = {}, must be 0.1 to 10", self.temperature),
            ),
        ];
        match rules.into_iter().find(|(holds, _)| !holds) {
            Some((_, text)) => Err(text),
            None => Ok(classes),
        }
    }
    /// The bytes of a model file. The same model gives the same bytes.
    ///
    /// # Errors
    /// If the tensors cannot be made.
    pub fn to_bytes(&self, weights: &Weights) -> Result<Vec<u8>, LearningError> {
        model_file::encode(ARCHITECTURE, VERSION, self, weights.to_tensors()?)
    }
}

/// A network on range images.
pub struct SphericalModel {
    card: ModelCard,
    settings: Settings,
    classes: Vec<ClassId>,
    network: Inference,
    every: usize,
}

impl SphericalModel {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, LearningError> {
        file.expect_version(VERSION)?;
        let settings: Settings = file.settings()?;
        settings.check().map_err(|reason| LearningError::Card { path: file.path.clone(), reason })?;
        let weights = Weights::from_file(&settings.network, file)?;
        Self::new(file.card.clone(), settings, &weights)
    }
    /// Reads a model file of this architecture.
    ///
    /// # Errors
    /// As [`crate::load`].
    pub fn load(path: &std::path::Path) -> Result<(Self, Weights), LearningError> {
        let file = ModelFile::read(path)?;
        let model = Self::from_file(&file)?;
        let weights = Weights::from_file(&model.settings.network, &file)?;
        Ok((model, weights))
    }
    /// From what training made.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn new(card: ModelCard, settings: Settings, weights: &Weights) -> Result<Self, LearningError> {
        let classes = settings.check().map_err(candle_core::Error::Msg)?;
        let network = Inference::new(settings.network.clone(), weights, Border::Circular)?;
        Ok(Self { card, settings, classes, network, every: 1 })
    }
    /// Only the first of every so many sweeps of a submap goes through the network; 1, the default, is all. Points of the
    /// others take the votes of those nearby.
    #[must_use]
    pub fn with_every(mut self, every: usize) -> Self {
        self.every = every.max(1);
        self
    }
    /// What the file says.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
    /// Multiplications and additions for one sweep of so many rings.
    pub fn flops(&self, rings: usize) -> usize {
        let rows = rings.next_multiple_of(self.network.spec().multiple_of()[0]);
        self.network.flops(rows, self.settings.columns / self.settings.fold)
    }
    /// Votes of the pixels of an image, rows of the classes in raster order: probabilities, 0 to 255 for 0 to 1. Those of pixels
    /// without a point mean nothing.
    ///
    /// # Errors
    /// If the image has other columns than the model.
    pub fn votes_of_pixels(&self, image: &PolarImage) -> Result<Vec<u8>, LearningError> {
        let input = features(image, self.settings.fold, self.network.spec().multiple_of()[0]);
        let logits = self.network.run(&input)?;
        let n_classes = self.classes.len();
        let mut votes = vec![0; image.pixels.len() * n_classes];
        let (fold, temperature) = (self.settings.fold, self.settings.temperature);
        Arch::new().dispatch(Softmax { image, logits: &logits, fold, n_classes, temperature, votes: &mut votes });
        Ok(votes)
    }
    /// Votes of one sweep for its own points, in rows of the classes.
    fn votes(&self, sweep: &Sweep) -> Result<Vec<u8>, LearningError> {
        let n_classes = self.classes.len();
        let of_pixels = self.votes_of_pixels(&sweep.polar)?;
        let mut votes = vec![0; sweep.points.len() * n_classes];
        for (point, row) in votes.chunks_exact_mut(n_classes).enumerate() {
            let Some(pixel) = pixel_for(&sweep.image, point) else { continue };
            row.copy_from_slice(&of_pixels[pixel as usize * n_classes..][..n_classes]);
        }
        Ok(votes)
    }
}

impl Segmenter for SphericalModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, cloud: &Cloud<'_>, classes: &mut [ClassRow]) -> Result<Report, LearningError> {
        cloud.check(classes)?;
        let heights_m = ground::heights(cloud)?;
        let of_sweep = |(of, points): (_, std::ops::Range<usize>)| {
            let sweep = sweep(cloud, &of, points, self.settings.columns, &heights_m);
            Ok((sweep.points.start, self.votes(&sweep)?))
        };
        // Each sweep on one thread: that scales better than threads inside a network, and the results have an order.
        let voted: Vec<Result<(usize, Vec<u8>), LearningError>> =
            point_ranges(cloud).into_par_iter().step_by(self.every).map(of_sweep).collect();
        let n_classes = self.classes.len();
        let mut votes = Votes { n_classes, rows: vec![0; cloud.points.len() * n_classes] };
        for sweep in voted {
            let (first, rows) = sweep?;
            votes.rows[first * n_classes..][..rows.len()].copy_from_slice(&rows);
        }
        let decided = votes.decide(cloud.points, self.settings.vote_cell_m);
        let mut n_unseen = 0;
        for (row, decision) in classes.iter_mut().zip(decided) {
            *row = if let Some((class, share)) = decision {
                ClassRow { class_id: self.classes[class] as u8, score: (share * 255.0).round() as u8 }
            } else {
                n_unseen += 1;
                ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 }
            };
        }
        Ok(Report { n_unseen, coarsened: 1 })
    }
}
