//! Ground by lambda-quasi-flat zones of the top view (thesis section 6.3.2; Serna and Marcotegui 2014).
//!
//! 1. *Elevation*: the lowest point of every cell of a top-view grid.
//! 2. *Zones*: a cell is joined with its nearest neighbors in row and column, also across gaps, if the step between them is at most
//!    that allowed for a gap of this length: a curb or a slope, but not the side of a car.
//! 3. *Ground zones*: large zones close to the morphological opening of the elevation. An opening keeps slopes, so the street may
//!    rise. Roofs of cars are small, crowns of trees are high. The roof of a house without visible ground around it is low, too:
//!    zones other than the largest must not be higher than ground that rises from the largest zone like a steep street (as in the
//!    slope-based filter of Vosselman 2000).
//! 4. *Terrain*: the elevation of the ground zones with filled gaps (digital terrain model).
//! 5. *Roughness*: where the lowest points scatter around a plane, low vegetation hides the ground.
//! 6. A point is ground if its distance to the terrain is within the tolerance, and the terrain is smooth. The upper tolerance admits
//!    a curb within a cell. In cells with an object, i.e. with points above the tolerance and below the height of a car, low points belong to the foot of
//!    the object, and the tolerance admits noise only. The score falls linearly from 1 on the terrain to 1/2 at the tolerance. It is
//!    not a probability.
//!
//! Road, sidewalk and terrain are not distinguished: a lowered curb joins their zones.

mod elevation;
mod parameters;
mod roughness;
mod terrain;

pub use parameters::{Parameters, Settings};

use crate::model_file::ModelFile;
use crate::{ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use elevation::Elevation;
use messages::{ClassId, ClassRow, SubmapPoint};
use roughness::rough_cells;
use std::sync::Arc;

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "ground_quasi_flat";

/// Version that this program writes and runs.
pub const VERSION: u32 = 3;

/// The ground model.
pub struct GroundQuasiFlat {
    card: ModelCard,
    parameters: Parameters,
}

impl GroundQuasiFlat {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        Ok(Self { card: file.card.clone(), parameters: Parameters::from_file(file)? })
    }
}

/// The ground below the points of a submap, by the default parameters.
pub struct Ground {
    parameters: Parameters,
    n_points: usize,
    /// `None` if none was found.
    found: Option<(Elevation, Vec<f32>)>,
}

/// The ground below a submap, and the heights of its points above it.
pub struct SubmapGround {
    pub(crate) found: Ground,
    /// m; NaN without terrain.
    pub(crate) heights_m: Vec<f32>,
}

impl SubmapGround {
    /// Finds the ground of a submap, to be shared by models.
    pub fn of(input: &ModelInput<'_>) -> Arc<Self> {
        let found = Ground::of(input);
        let heights_m = found.heights(input.points);
        Arc::new(Self { found, heights_m })
    }
}

impl Ground {
    /// Finds the ground.
    pub fn of(input: &ModelInput<'_>) -> Self {
        let parameters = Parameters::default();
        let found = Elevation::of(input, &parameters.settings).and_then(|elevation| {
            let terrain = terrain::terrain(&elevation, &parameters)?;
            Some((elevation, terrain))
        });
        Self { parameters, n_points: input.points.len(), found }
    }
    /// Height of every point above the terrain, m. NaN without terrain. `points` are those of the submap.
    pub fn heights(&self, points: &[SubmapPoint]) -> Vec<f32> {
        let heights = self.found.as_ref().map(|(elevation, terrain)| heights_above(terrain, elevation, points));
        heights.unwrap_or_else(|| vec![f32::NAN; points.len()])
    }
    /// Whether each point lies where the terrain is rougher than ground: if it is low, on low vegetation.
    pub fn is_rough(&self) -> Vec<bool> {
        let is_rough = self.found.as_ref().map(|(elevation, terrain)| {
            let is_rough = rough_ground(elevation, terrain, &self.parameters);
            elevation.cells.iter().map(|cell| is_rough[*cell as usize]).collect()
        });
        is_rough.unwrap_or_else(|| vec![false; self.n_points])
    }
    /// The class of every point by the ground model: ground with a score, or unlabeled. `heights_m` are those of [`Self::heights`].
    pub fn classes(&self, heights_m: &[f32]) -> Vec<ClassRow> {
        let mut classes = vec![UNLABELED; self.n_points];
        if let Some((elevation, terrain)) = &self.found {
            mark_ground(heights_m, elevation, terrain, &self.parameters, &mut classes);
        }
        classes
    }
}

/// Height of every point above the terrain of the default parameters, m. NaN without terrain.
pub fn heights(input: &ModelInput<'_>) -> Vec<f32> {
    Ground::of(input).heights(input.points)
}

/// The class of a point that is not ground.
const UNLABELED: ClassRow = ClassRow { class_id: ClassId::Unlabeled as u8, score: 0 };

/// Heights above the terrain. NaN for points outside of the grid, whose terrain is at infinity.
fn heights_above(terrain: &[f32], elevation: &Elevation, points: &[SubmapPoint]) -> Vec<f32> {
    let height = |(point, &cell): (&SubmapPoint, &u32)| {
        let height = point.z - terrain[cell as usize];
        if height.is_finite() { height } else { f32::NAN }
    };
    points.iter().zip(&elevation.cells).map(height).collect()
}

/// Gives ground points their class. The others keep theirs.
fn mark_ground(
    heights_m: &[f32],
    elevation: &Elevation,
    terrain: &[f32],
    parameters: &Parameters,
    classes: &mut [ClassRow],
) {
    let Parameters { settings, tolerance_m: [below_m, above_m, foot_m], .. } = parameters;
    let object_heights = *above_m..settings.standing_m as f32;
    let mut has_object = vec![false; terrain.len()];
    for (height_m, &cell) in heights_m.iter().zip(&elevation.cells) {
        has_object[cell as usize] |= object_heights.contains(height_m);
    }
    let is_rough = rough_ground(elevation, terrain, parameters);
    for ((row, &height_m), &cell) in classes.iter_mut().zip(heights_m).zip(&elevation.cells) {
        let tolerance_m = match (height_m < 0.0, has_object[cell as usize]) {
            (true, _) => below_m,
            (false, true) => foot_m,
            (false, false) => above_m,
        };
        let off = height_m.abs() / tolerance_m;
        if off <= 1.0 && !is_rough[cell as usize] {
            let score = (255.0 - 127.5 * off).round() as u8;
            *row = ClassRow { class_id: ClassId::Ground as u8, score };
        }
    }
}

/// Whether the ground of each cell is rougher than ground can be. One element more, for points outside of the grid.
fn rough_ground(elevation: &Elevation, terrain: &[f32], parameters: &Parameters) -> Vec<bool> {
    let Parameters { settings, tolerance_m: [below_m, above_m, _], .. } = parameters;
    let mut ground_m = elevation.lowest_m.clone();
    for (lowest_m, terrain_m) in ground_m.iter_mut().zip(terrain) {
        if !(-below_m..=*above_m).contains(&(*lowest_m - terrain_m)) {
            *lowest_m = f32::NAN;
        }
    }
    rough_cells(&ground_m, settings.rough_m as f32).into_iter().chain([false]).collect()
}

impl Segmenter for GroundQuasiFlat {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        classes.fill(UNLABELED);
        let nothing = Report { n_unseen: input.points.len(), coarsened: 1, ..Report::default() };
        let Some(elevation) = Elevation::of(input, &self.parameters.settings) else { return Ok(nothing) };
        let coarsened = elevation.coarsened(&self.parameters.settings);
        let report = Report { n_unseen: elevation.n_outside, coarsened, ..Report::default() };
        let Some(terrain) = terrain::terrain(&elevation, &self.parameters) else { return Ok(report) };
        let heights_m = heights_above(&terrain, &elevation, input.points);
        mark_ground(&heights_m, &elevation, &terrain, &self.parameters, classes);
        Ok(report)
    }
}
