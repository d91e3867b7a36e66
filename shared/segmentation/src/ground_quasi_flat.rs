//! The model that gives ground points their class, without a network (crate [`ground`]), and its model file.

use crate::model_file::{ModelFile, encode_model};
use crate::{LidarAboveGround, ModelCard, ModelInput, Report, SegmentationError, Segmenter};
use candle_core::{Device, Tensor};
use ground::{Ground, MAX_GAP_CELLS, OutOfRange, Parameters, Settings, Tolerance};
use messages::ClassRow;
use std::collections::BTreeMap;

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "ground_quasi_flat";

/// Version that this program writes and runs.
pub const VERSION: u32 = 4;

/// The ground model: road, sidewalk and terrain are not distinguished, all other points are unlabeled.
pub struct GroundQuasiFlat {
    card: ModelCard,
    parameters: Parameters,
}

impl GroundQuasiFlat {
    pub(crate) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        file.expect_version(VERSION)?;
        Ok(Self { card: file.card.clone(), parameters: read_parameters(file)? })
    }
}

/// The valid parameters of a file of this architecture.
fn read_parameters(file: &ModelFile) -> Result<Parameters, SegmentationError> {
    let settings: Settings = file.settings()?;
    if let Some(OutOfRange { key, value, low, high }) = settings.out_of_range() {
        return Err(SegmentationError::Setting { path: file.path.clone(), key, value, low, high });
    }
    let steps_m = file.vector("steps_m", 1..=MAX_GAP_CELLS)?;
    if let Some(idx) = steps_m.iter().position(|&step| step < 0.0) {
        return Err(file.bad_tensor("steps_m", format!("element {idx} is {}, must be at least 0", steps_m[idx])));
    }
    let tolerance_m = file.vector("tolerance_m", 3..=3)?;
    if tolerance_m.iter().any(|&tolerance| tolerance <= 0.0) {
        return Err(file.bad_tensor("tolerance_m", format!("is {tolerance_m:?}, all must be above 0")));
    }
    let tolerance = Tolerance { below_m: tolerance_m[0], above_m: tolerance_m[1], foot_m: tolerance_m[2] };
    Ok(Parameters { settings, steps_m, tolerance })
}

/// The bytes of a model file with these parameters. Equal parameters give equal bytes.
///
/// # Errors
/// If the file cannot be encoded.
pub fn encode(parameters: &Parameters) -> Result<Vec<u8>, SegmentationError> {
    let tensor = |values: &[f32]| Tensor::from_slice(values, values.len(), &Device::Cpu);
    let Tolerance { below_m, above_m, foot_m } = parameters.tolerance;
    let tolerance_m = tensor(&[below_m, above_m, foot_m])?;
    let tensors = BTreeMap::from([("steps_m", tensor(&parameters.steps_m)?), ("tolerance_m", tolerance_m)]);
    encode_model(ARCHITECTURE, VERSION, &parameters.settings, tensors)
}

impl Segmenter for GroundQuasiFlat {
    fn card(&self) -> &ModelCard {
        &self.card
    }

    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
        input.check(classes)?;
        let ground = Ground::find_with(input.header, input.points, self.parameters.clone());
        let heights_m = ground.heights(input.points);
        classes.copy_from_slice(&ground.classes(&heights_m));
        let lidar = LidarAboveGround::find(input.header, input.points, &heights_m);
        Ok(Report { n_unseen: ground.n_outside(), coarsened: ground.coarsened(), lidar, ..Report::default() })
    }
}
