//! The model: settings, parameters, and the classification of a submap.

use super::cells::{CellCloud, NO_CELL, cell_of_each};
use super::parameters::Parameters;
use super::settings::{PointSettings, VERSION};
use super::spheres::SpherePrediction;
use crate::ground::Ground;
use crate::model_file::ModelFile;
use crate::network::Weights;
use crate::segmenter::class_row;
use crate::spherical::{IntensityMap, Options};
use crate::{ComputeDevice, ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use messages::{ClassId, ClassRow};
use neighbors::SpatialIndex;
use std::path::Path;

/// Seed of the centers of `PointNet++`: equal submaps give equal classes.
const SEED: u64 = 0;

/// A network on points.
pub struct PointModel {
    card: ModelCard,
    settings: PointSettings,
    classes: Vec<ClassId>,
    parameters: Parameters,
    options: Options,
}

/// Best class of a cell and its probability.
type Decision = (usize, f32);

impl PointModel {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        let settings: PointSettings = file.settings()?;
        let classes = settings
            .check()
            .map_err(|error| SegmentationError::Card { path: file.path.clone(), reason: error.to_string() })?;
        let parameters = settings.parameters(file)?;
        Ok(Self { card: file.card.clone(), settings, classes, parameters, options: Options::default() })
    }
    /// Reads a model file of this architecture.
    ///
    /// # Errors
    /// As [`crate::load`].
    pub fn load(path: &Path) -> Result<(Self, Weights), SegmentationError> {
        let model = Self::from_file(&ModelFile::read(path)?)?;
        let weights = model.parameters.weights()?;
        Ok((model, weights))
    }
    /// Sets the options; those of sweeps are not used.
    ///
    /// # Errors
    /// If the device is a GPU: the operations on points have no kernels for it.
    pub fn with_options(mut self, options: Options) -> Result<Self, SegmentationError> {
        if options.device == ComputeDevice::Cuda {
            return Err(SegmentationError::PointsOnGpu);
        }
        self.options = options;
        Ok(self)
    }
    /// Settings of the model.
    pub fn settings(&self) -> &PointSettings {
        &self.settings
    }
    /// The best class of each cell. A cell without votes gets that of the nearest cell with votes, if there is one.
    fn decide(&self, cloud: &CellCloud) -> Result<Vec<Option<Decision>>, SegmentationError> {
        let settings = &self.settings;
        let prediction = SpherePrediction {
            network: &settings.network,
            parameters: &self.parameters,
            spheres: settings.spheres,
            temperature: settings.temperature,
            seed: SEED,
        };
        let probabilities = prediction.of_cloud(&cloud.positions, |center, points| {
            let sphere = cloud.around(center, points);
            let features = sphere.features(&settings.features);
            (sphere.positions, features)
        })?;
        let mut decisions: Vec<Option<Decision>> =
            probabilities.chunks_exact(self.classes.len()).map(best_of).collect();
        let (voted, open): (Vec<usize>, Vec<usize>) = (0..cloud.len()).partition(|cell| decisions[*cell].is_some());
        if open.is_empty() || voted.is_empty() {
            return Ok(decisions);
        }
        let positions = |cells: &[usize]| cells.iter().map(|cell| cloud.positions[*cell]).collect::<Vec<_>>();
        let nearest = SpatialIndex::new(&positions(&voted)).nearest_of_each(&positions(&open), 1);
        for (query, cell) in open.into_iter().enumerate() {
            let found = nearest.of(query).first();
            decisions[cell] = found.and_then(|neighbor| decisions[voted[neighbor.index as usize]]);
        }
        Ok(decisions)
    }
}

/// The best class, of equal ones the first; `None` without votes.
fn best_of(probabilities: &[f32]) -> Option<Decision> {
    let best = (0..probabilities.len()).rev().max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]))?;
    (probabilities[best] > 0.0).then_some((best, probabilities[best]))
}

impl Segmenter for PointModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let ground = Ground::of(input);
        let heights_m = ground.heights(input.points);
        let trained = self.settings.ground_intensities;
        let (intensities, foreign_intensity) =
            IntensityMap::of(self.options.intensity, input.points, &heights_m, trained);
        let (cloud, grid) = CellCloud::of(input, &heights_m, &intensities, self.settings.cell_m)?;
        let cells = cell_of_each(&grid, input.points.len());
        drop(grid);
        let decisions = self.decide(&cloud)?;
        let mut n_unseen = 0;
        for (row, cell) in classes.iter_mut().zip(cells) {
            let decision = if cell == NO_CELL { None } else { decisions[cell as usize] };
            *row = class_row(decision.map(|(class, probability)| (self.classes[class], probability)));
            n_unseen += usize::from(decision.is_none());
        }
        self.options.refinement.of_points(input.points, (&ground, &heights_m), &self.classes, classes);
        Ok(Report { n_unseen, n_unknown: 0, coarsened: 1, foreign_intensity })
    }
}
