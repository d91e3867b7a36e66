//! Ground by lambda-quasi-flat zones of the top-down view (thesis section 6.3.2; Serna and Marcotegui 2014).
//!
//! 1. *Elevation*: the lowest point of every cell of a top-down grid.
//! 2. *Zones*: cells are joined to their nearest neighbors in row and column, over gaps too, if the step between them is
//!    at most that which the model allows for a gap of that length: a kerb or a slope, but not the side of a car.
//! 3. *Ground zones*: large ones that lie low, i.e. on the morphological opening of the elevation. An opening keeps
//!    slopes, so the street may climb. Roofs of cars are small, crowns of trees lie high.
//! 4. *Terrain*: the elevation of the ground zones with the gaps between them bridged (DEM).
//! 5. A point is ground if it lies within the tolerance of the terrain; its score falls linearly from 1 on the terrain to
//!    1/2 at the tolerance. It is no probability.
//!
//! Heights and scores of the points are candle tensors on the CPU, as a network's would be; zones and openings are no
//! tensor operations and come from `morphology`. Road, sidewalk and terrain are not told apart: a lowered kerb joins their
//! zones.

mod elevation;
mod parameters;
mod terrain;

pub use parameters::{Parameters, Settings};

use crate::model_file::ModelFile;
use crate::{Cloud, LearningError, ModelCard, Report, Segmenter};
use candle_core::{Device, Tensor};
use elevation::Elevation;
use messages::{ClassId, ClassRow, SubmapPoint};

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "ground_quasi_flat";

/// Version that this program writes and runs.
pub const VERSION: u32 = 1;

/// Points for which tensors are made at a time: 64 KiB each, so that a chunk's tensors stay in the cache. Less than the
/// 65 536 elements from which candle hands an operation to its own threads, which then spin until the next one.
const CHUNK: usize = 1 << 14;

/// The model of this module.
pub struct GroundQuasiFlat {
    card: ModelCard,
    parameters: Parameters,
}

impl GroundQuasiFlat {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, LearningError> {
        file.expect_version(VERSION)?;
        Ok(Self { card: file.card.clone(), parameters: Parameters::from_file(file)? })
    }

    /// Class and score of some points against the terrain.
    ///
    /// `terrain` has one element more than the grid has cells, infinitely high, for the points outside.
    fn decide(
        &self,
        terrain: &Tensor,
        cells: &[u32],
        points: &[SubmapPoint],
        classes: &mut [ClassRow],
    ) -> Result<(), LearningError> {
        let [below_m, above_m] = self.parameters.tolerance_m.map(f64::from);
        let device = Device::Cpu;
        // A relu turns NaN, also that of infinity minus infinity, into 0: right on the terrain.
        let finite = |z: f32| if z.is_finite() { z } else { 0.0 };
        let z = Tensor::from_iter(points.iter().map(|point| finite(point.z)), &device)?;
        let cells = Tensor::from_slice(cells, cells.len(), &device)?;
        let height = (z - terrain.index_select(&cells, 0)?)?;
        // Heights in units of the tolerance of their side.
        let above = (height.relu()? / above_m)?;
        let off = (above + (height.neg()?.relu()? / below_m)?)?;
        let is_ground = off.le(1.0)?.to_vec1::<u8>()?;
        let scores = off.clamp(0.0, 1.0)?.affine(-127.5, 255.0)?.to_vec1::<f32>()?;
        for ((row, is_ground), score) in classes.iter_mut().zip(is_ground).zip(scores) {
            *row = match is_ground {
                0 => ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 },
                _ => ClassRow { class_id: ClassId::Ground as u8, score: score.round() as u8 },
            };
        }
        Ok(())
    }
}

/// Height of every point above the terrain that the default parameters find, m. Not a number where there is no terrain.
///
/// # Errors
/// If candle fails.
pub fn heights(cloud: &Cloud<'_>) -> Result<Vec<f32>, LearningError> {
    let parameters = Parameters::default();
    let unknown = || vec![f32::NAN; cloud.points.len()];
    let Some(elevation) = Elevation::of(cloud, &parameters.settings) else { return Ok(unknown()) };
    let Some(terrain) = terrain::terrain(&elevation, &parameters)? else { return Ok(unknown()) };
    let terrain = terrain.to_vec1::<f32>()?;
    let height = |(point, &cell): (&SubmapPoint, &u32)| {
        // Points outside the grid have a terrain of infinite height.
        let height = point.z - terrain[cell as usize];
        if height.is_finite() { height } else { f32::NAN }
    };
    Ok(cloud.points.iter().zip(&elevation.cells).map(height).collect())
}

impl Segmenter for GroundQuasiFlat {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, cloud: &Cloud<'_>, classes: &mut [ClassRow]) -> Result<Report, LearningError> {
        cloud.check(classes)?;
        classes.fill(ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 });
        let nothing = Report { n_unseen: cloud.points.len(), coarsened: 1 };
        let Some(elevation) = Elevation::of(cloud, &self.parameters.settings) else { return Ok(nothing) };
        let coarsened = elevation.coarsened(&self.parameters.settings);
        let report = Report { n_unseen: elevation.n_outside, coarsened };
        let Some(terrain) = terrain::terrain(&elevation, &self.parameters)? else { return Ok(report) };
        let chunks = classes.chunks_mut(CHUNK).zip(cloud.points.chunks(CHUNK)).zip(elevation.cells.chunks(CHUNK));
        for ((classes, points), cells) in chunks {
            self.decide(&terrain, cells, points, classes)?;
        }
        Ok(report)
    }
}
