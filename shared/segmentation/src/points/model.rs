//! The model: settings, parameters, and the classification of a submap.

use super::cells::{CellCloud, GriddedCells, cell_of_each};
use super::parameters::Parameters;
use super::prediction::{CloudPrediction, RegionInput};
use super::settings::{PointSettings, VERSION};
use crate::cell_probabilities::is_known;
use crate::decision::segment_by_cells;
use crate::intensity::SubmapIntensities;
use crate::model_file::ModelFile;
use crate::network::Weights;
use crate::options::Options;
use crate::refinement::Refinement;
use crate::segmenter::CellSegmenter;
use crate::{
    CellProbabilities, ComputeDevice, LidarAboveGround, ModelCard, ModelInput, Report, SegmentationError, Segmenter,
    SubmapProbabilities,
};
use ground::SubmapGround;
use messages::{ClassId, ClassRow};
use neighbors::SpatialIndex;
use std::path::Path;
use std::sync::Arc;

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
    /// The errors of [`crate::load`].
    pub fn load(path: &Path) -> Result<Self, SegmentationError> {
        Self::from_file(&ModelFile::read(path)?)
    }
    /// The weights of the model.
    ///
    /// # Errors
    /// If the weights cannot be copied.
    pub fn weights(&self) -> Result<Weights, SegmentationError> {
        self.parameters.weights()
    }
    /// Sets the options; options of sweeps are not used.
    ///
    /// # Errors
    /// If the device is a GPU: the operations on points have no GPU kernels.
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
    /// The probabilities of the classes in each cell. A cell without votes gets the probabilities of the nearest cell
    /// with votes, if there is one.
    fn per_cell(&self, cloud: &CellCloud) -> Result<Vec<f32>, SegmentationError> {
        let settings = &self.settings;
        let prediction = CloudPrediction {
            network: &settings.network,
            parameters: &self.parameters,
            regions: settings.regions(),
            temperature: settings.temperature,
            seed: SEED,
        };
        let mut probabilities = prediction.per_point(&cloud.positions, |region| {
            let cells = cloud.around(region.center, &region.points);
            let features = cells.features(&settings.features);
            RegionInput { positions: cells.positions, features }
        })?;
        let n_classes = self.classes.len();
        let is_voted = |cell: &usize| is_known(&probabilities[cell * n_classes..][..n_classes]);
        let (voted, open): (Vec<usize>, Vec<usize>) = (0..cloud.len()).partition(is_voted);
        if open.is_empty() || voted.is_empty() {
            return Ok(probabilities);
        }
        let positions = |cells: &[usize]| cells.iter().map(|cell| cloud.positions[*cell]).collect::<Vec<_>>();
        let nearest = SpatialIndex::new(&positions(&voted)).nearest_of_each(&positions(&open), 1);
        for (query, cell) in open.into_iter().enumerate() {
            if let Some(neighbor) = nearest.get(query).first() {
                let from = voted[neighbor.index as usize] * n_classes;
                probabilities.copy_within(from..from + n_classes, cell * n_classes);
            }
        }
        Ok(probabilities)
    }
}

impl Segmenter for PointModel {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        segment_by_cells(self, self.options.views, input, classes)
    }
}

impl CellSegmenter for PointModel {
    fn classes(&self) -> &[ClassId] {
        &self.classes
    }
    fn refinement(&self) -> Refinement {
        self.options.refinement
    }
    fn probabilities(
        &self,
        input: &ModelInput<'_>,
        ground: &Arc<SubmapGround>,
    ) -> Result<SubmapProbabilities, SegmentationError> {
        let trained = self.settings.ground_intensities;
        let SubmapIntensities { map, foreign } =
            SubmapIntensities::find(self.options.intensity, input.points, &ground.heights_m, trained);
        let GriddedCells { cloud, grid } = CellCloud::from_input(input, &ground.heights_m, &map, self.settings.cell_m)?;
        let cell_of_point = cell_of_each(&grid, input.points.len());
        drop(grid);
        let cells = CellProbabilities::new(self.classes.len(), self.per_cell(&cloud)?, cell_of_point);
        let lidar = LidarAboveGround::find(input.header, input.points, &ground.heights_m);
        let report = Report { coarsened: 1, foreign_intensity: foreign, lidar, ..Report::default() };
        Ok(SubmapProbabilities { cells, report })
    }
}
