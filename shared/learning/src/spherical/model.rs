//! The model: settings and weights from a file, and what it makes of a submap.

use super::back_projection::pixel_for;
use super::features::write_features;
use super::softmax::{MAX_CLASSES, Softmax, Vote};
use super::sweeps::{point_ranges, rows_of, sweep};
use super::votes::Votes;
use super::{N_FEATURES, Neighbors, PolarImage};
use crate::engine::Border;
use crate::ground;
use crate::model_file::{self, ModelFile};
use crate::network::{Inference, NetworkSpec, Weights};
use crate::{Cloud, LearningError, ModelCard, Options, Report, Segmenter};
use geometry::NO_POINT;
use messages::{ClassId, ClassRow, SubmapSweep};
use pulp::Arch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

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
    options: Options,
    neighbors: Option<Neighbors>,
    /// Votes of an earlier submap, to be written again: to clear new memory takes a tenth of the time.
    spare: Mutex<Vec<Vote>>,
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
        Ok(Self {
            card,
            settings,
            classes,
            network,
            options: Options::default(),
            neighbors: None,
            spare: Mutex::default(),
        })
    }
    /// Has the nearest examples tell the classes of pixels in place of the network's last layer. `weights` are the model's.
    ///
    /// # Errors
    /// If the weights do not fit the settings.
    pub fn with_neighbors(self, neighbors: Neighbors, weights: &Weights) -> Result<Self, LearningError> {
        let network = Inference::of_features(self.settings.network.clone(), weights, Border::Circular)?;
        Ok(Self { network, neighbors: Some(neighbors), ..self })
    }
    /// Runs as `options` say. If only the first of every so many sweeps goes through the network, points of the others take the
    /// votes of those nearby.
    #[must_use]
    pub fn with_options(mut self, options: Options) -> Self {
        self.options = Options { every: options.every.max(1), ..options };
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
    /// Votes of the pixels of an image in raster order. Those of pixels without a point are left as they are.
    fn vote(&self, image: &PolarImage, votes: &mut [Vote]) -> Result<(), LearningError> {
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

    fn segment(&self, cloud: &Cloud<'_>, classes: &mut [ClassRow]) -> Result<Report, LearningError> {
        cloud.check(classes)?;
        let heights_m = ground::heights(cloud);
        let ranges: Vec<_> = point_ranges(cloud).into_iter().step_by(self.options.every).collect();
        let n_pixels = rows_of(cloud.header) * self.settings.columns;
        let mut of_pixels = std::mem::take(&mut *self.spare.lock().unwrap_or_else(PoisonError::into_inner));
        of_pixels.resize(ranges.len() * n_pixels, [0; MAX_CLASSES]);
        let of_sweep = |number: usize, (of, points): &(SubmapSweep, Range<usize>), votes: &mut [Vote]| {
            let sweep = sweep(cloud, of, points.clone(), self.settings.columns, &heights_m);
            self.vote(&sweep.polar, votes)?;
            self.options.refinement.of_image(&sweep.polar, &self.classes, votes);
            let first = (number * n_pixels) as u32;
            let pixel = |point| pixel_for(&sweep.image, point).map_or(NO_POINT, |pixel| first + pixel);
            Ok((0..points.len()).map(pixel).collect())
        };
        // Each sweep on one thread: that scales better than threads inside a network, and the results have an order.
        let voted: Vec<Result<Vec<u32>, LearningError>> = ranges
            .par_iter()
            .zip(of_pixels.par_chunks_exact_mut(n_pixels))
            .enumerate()
            .map(|(number, (range, votes))| of_sweep(number, range, votes))
            .collect();
        let mut pixel_of_point = vec![NO_POINT; cloud.points.len()];
        for ((_, points), pixels) in ranges.iter().zip(voted) {
            pixel_of_point[points.clone()].copy_from_slice(&pixels?);
        }
        let votes = Votes { of_pixels: &of_pixels, pixel_of_point: &pixel_of_point };
        let decided = votes.decide(cloud.points, self.settings.vote_cell_m);
        *self.spare.lock().unwrap_or_else(PoisonError::into_inner) = of_pixels;
        let mut n_unseen = 0;
        for (row, decision) in classes.iter_mut().zip(decided) {
            *row = if let Some((class, share)) = decision {
                ClassRow { class_id: self.classes[class] as u8, score: (share * 255.0).round() as u8 }
            } else {
                n_unseen += 1;
                ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 }
            };
        }
        self.options.refinement.of_points(cloud.points, &heights_m, classes);
        Ok(Report { n_unseen, coarsened: 1 })
    }
}
