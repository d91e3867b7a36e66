//! Ground by lambda-quasi-flat zones of the top-down view (thesis section 6.3.2; Serna and Marcotegui 2014).
//!
//! 1. *Elevation*: the lowest point of every cell of a top-down grid.
//! 2. *Zones*: cells are joined to their nearest neighbors in row and column, over gaps too, if the step between them is
//!    at most that which the model allows for a gap of that length: a kerb or a slope, but not the side of a car.
//! 3. *Ground zones*: large ones that lie low, i.e. on the morphological opening of the elevation. An opening keeps
//!    slopes, so the street may climb. Roofs of cars are small, crowns of trees lie high. But where nothing was seen of the
//!    ground around it, a house's roof is low, too; so zones besides the largest must not lie higher than ground gets that rises
//!    from there as a steep street does (as in the slope-based filter of Vosselman 2000).
//! 4. *Terrain*: the elevation of the ground zones with the gaps between them bridged (DEM).
//! 5. A point is ground if it lies within the tolerance of the terrain. Above, that is as wide as a kerb within a cell; but where
//!    something stands in the cell, i.e. has points above the tolerance and below the height of a car, what is low is its
//!    foot, and only noise is allowed. The score falls linearly from 1 on the terrain to 1/2 at the tolerance. It is no
//!    probability.
//!
//! Road, sidewalk and terrain are not told apart: a lowered kerb joins their zones.

mod elevation;
mod parameters;
mod terrain;

pub use parameters::{Parameters, Settings};

use crate::model_file::ModelFile;
use crate::{Cloud, LearningError, ModelCard, Report, Segmenter};
use elevation::Elevation;
use messages::{ClassId, ClassRow, SubmapPoint};

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "ground_quasi_flat";

/// Version that this program writes and runs.
pub const VERSION: u32 = 2;

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
}

/// Height of every point above the terrain that the default parameters find, m. Not a number where there is no terrain.
pub fn heights(cloud: &Cloud<'_>) -> Vec<f32> {
    let parameters = Parameters::default();
    let elevation = Elevation::of(cloud, &parameters.settings);
    let heights = elevation.and_then(|elevation| {
        let terrain = terrain::terrain(&elevation, &parameters)?;
        Some(heights_above(&terrain, &elevation, cloud.points))
    });
    heights.unwrap_or_else(|| vec![f32::NAN; cloud.points.len()])
}

/// Not a number for points outside the grid, whose terrain is infinitely high.
fn heights_above(terrain: &[f32], elevation: &Elevation, points: &[SubmapPoint]) -> Vec<f32> {
    let height = |(point, &cell): (&SubmapPoint, &u32)| {
        let height = point.z - terrain[cell as usize];
        if height.is_finite() { height } else { f32::NAN }
    };
    points.iter().zip(&elevation.cells).map(height).collect()
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
        let Some(terrain) = terrain::terrain(&elevation, &self.parameters) else { return Ok(report) };
        let heights_m = heights_above(&terrain, &elevation, cloud.points);
        let Parameters { settings, tolerance_m: [below_m, above_m, foot_m], .. } = &self.parameters;
        let stands = *above_m..settings.standing_m as f32;
        let mut is_standing = vec![false; terrain.len()];
        for (height_m, &cell) in heights_m.iter().zip(&elevation.cells) {
            is_standing[cell as usize] |= stands.contains(height_m);
        }
        for ((row, &height_m), &cell) in classes.iter_mut().zip(&heights_m).zip(&elevation.cells) {
            let tolerance_m = match (height_m < 0.0, is_standing[cell as usize]) {
                (true, _) => below_m,
                (false, true) => foot_m,
                (false, false) => above_m,
            };
            let off = height_m.abs() / tolerance_m;
            if off <= 1.0 {
                let score = (255.0 - 127.5 * off).round() as u8;
                *row = ClassRow { class_id: ClassId::Ground as u8, score };
            }
        }
        Ok(report)
    }
}
