//! Settings of a model file of a network on points, and their rules.

use super::features::PointFeature;
use super::parameters::Parameters;
use super::prediction::Regions;
use super::spec::PointNetworkSpec;
use super::spheres::SphereSettings;
use super::squares::SquareSettings;
use crate::SegmentationError;
use crate::intensity::GroundIntensities;
use crate::model_file::encode_model;
use crate::network::Weights;
use crate::settings_rules::{Rule, check_rules, classes_of_names};
use messages::ClassId;
use serde::{Deserialize, Serialize};

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "points";

/// Version that this program writes and runs.
pub const VERSION: u32 = 1;

/// Largest number of cells along the radius of a sphere: larger spheres would need more memory than the other stages
/// leave.
const MOST_CELLS: f32 = 500.0;

/// Settings of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointSettings {
    /// The network.
    pub network: PointNetworkSpec,
    /// Names of the classes, in the order of the outputs.
    pub classes: Vec<String>,
    /// Features of a point, in the order of the inputs.
    pub features: Vec<PointFeature>,
    /// Side of the cells that are one point of the network, m, 0.02 to 5.
    pub cell_m: f32,
    /// Spheres of the training, and of the prediction if there are no squares.
    pub spheres: SphereSettings,
    /// Squares of the prediction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub squares: Option<SquareSettings>,
    /// Divisor of the logits that calibrates the scores, 0.1 to 10.
    pub temperature: f32,
    /// Intensities of the ground in the training data, below which 5, 25, 50, 75 and 95 % of its points lie. By
    /// default, the intensities of the simulated towns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_intensities: Option<GroundIntensities>,
    /// What users of the model must know, such as a restriction by its training data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notice: Option<String>,
}

impl PointSettings {
    /// Regions that the network processes at a time in prediction.
    pub fn regions(&self) -> Regions {
        self.squares.map_or(Regions::Spheres(self.spheres), Regions::Squares)
    }
    /// The class of every output.
    ///
    /// # Errors
    /// [`SegmentationError::Settings`] with the violated rule.
    pub fn check(&self) -> Result<Vec<ClassId>, SegmentationError> {
        let wrong = SegmentationError::Settings;
        let classes = classes_of_names(&self.classes)?;
        if let Some(problem) = self.network.problem() {
            return Err(wrong(format!("network: {problem}")));
        }
        if let Some(problem) = self.spheres.problem() {
            return Err(wrong(format!("spheres: {problem}")));
        }
        if let Some(problem) = self.squares.and_then(|squares| squares.problem()) {
            return Err(wrong(format!("squares: {problem}")));
        }
        let inputs = self.network.inputs();
        let outputs = self.network.outputs();
        let n_values = PointFeature::channels(&self.features);
        let cell_m = self.cell_m;
        let radius_m = self.spheres.radius_m;
        let rules = [
            Rule::new(
                (1..=ClassId::ALL.len()).contains(&classes.len()),
                format!("{} classes, must be 1 to {}", classes.len(), ClassId::ALL.len()),
            ),
            Rule::new(
                inputs == n_values,
                format!("network.inputs = {inputs}, must be the {n_values} values of the features"),
            ),
            Rule::new(
                outputs == classes.len(),
                format!("network.outputs = {outputs}, must be the {} classes", classes.len()),
            ),
            Rule::new((0.02..=5.0).contains(&cell_m), format!("cell_m = {cell_m}, must be 0.02 to 5")),
            Rule::new(
                radius_m <= MOST_CELLS * cell_m,
                format!("spheres.radius_m = {radius_m}, must be at most {MOST_CELLS} cells of {cell_m} m"),
            ),
            Rule::new(
                self.squares.is_none_or(|squares| squares.side_m <= 2.0 * MOST_CELLS * cell_m),
                format!("squares.side_m must be at most {} cells of {cell_m} m", 2.0 * MOST_CELLS),
            ),
            Rule::new(
                match &self.network {
                    PointNetworkSpec::Kpconv(network) => network.cell_m == cell_m,
                    _ => true,
                },
                format!("network.cell_m must be cell_m = {cell_m}: the neighborhoods of kpconv are multiples of it"),
            ),
            Rule::for_temperature(self.temperature),
        ];
        check_rules(rules)?;
        Ok(classes)
    }
    /// The bytes of a model file. Equal models give equal bytes.
    ///
    /// # Errors
    /// If the file cannot be encoded.
    pub fn to_bytes(&self, weights: &Weights) -> Result<Vec<u8>, SegmentationError> {
        encode_model(ARCHITECTURE, VERSION, self, weights.to_tensors()?)
    }
    /// The parameters in a file of this architecture.
    pub(super) fn parameters(&self, file: &crate::ModelFile) -> Result<Parameters, SegmentationError> {
        Parameters::from_file(&self.network.parameters(), file)
    }
}
