//! Settings of a model file, and their rules.

use super::Features;
use super::nearest_examples::{ColumnExamples, MOST_NEAREST, NearestSettings};
use super::softmax::MAX_CLASSES;
use crate::SegmentationError;
use crate::intensity::GroundIntensities;
use crate::model_file::{ModelFile, encode_model};
use crate::network::{NetworkSpec, Weights};
use crate::settings_rules::{Rule, check_rules, classes_of_names};
use messages::ClassId;
use serde::{Deserialize, Serialize};

/// Name of the architecture in model files.
pub const ARCHITECTURE: &str = "spherical";

/// Version that this program writes and runs.
pub const VERSION: u32 = 1;

/// Settings of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The network. It has `fold` times the features as inputs and `fold` times the classes as outputs.
    pub network: NetworkSpec,
    /// Columns of a range image, 64 to 8192.
    pub columns: usize,
    /// Neighboring columns that are one pixel of the network, 1 to 16.
    pub fold: usize,
    /// Names of the classes, in the order of the outputs.
    pub classes: Vec<String>,
    /// Side of the cells in which sweeps vote, m, 0.02 to 5.
    pub vote_cell_m: f32,
    /// Divisor of the logits that calibrates the scores, 0.1 to 10.
    pub temperature: f32,
    /// Intensities of the ground in the training data, below which 5, 25, 50, 75 and 95 % of its points lie. By
    /// default, the intensities of the simulated towns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_intensities: Option<GroundIntensities>,
    /// Input features, in order.
    #[serde(default, skip_serializing_if = "Features::is_default")]
    pub features: Features,
    /// Treatment of ground points.
    #[serde(default, skip_serializing_if = "GroundUse::is_default")]
    pub ground: GroundUse,
    /// Classification by nearest examples instead of the last layer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest: Option<NearestSettings>,
    /// What users of the model must know, such as a restriction by its training data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notice: Option<String>,
}

/// Treatment of the points that are ground according to the ground model with its default parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GroundUse {
    /// They are in the image, and the network classifies them.
    #[default]
    Kept,
    /// They are not in the image. Their class is `ground`, with the score of the ground model (thesis section 6.3.2).
    Removed,
}

impl GroundUse {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Settings {
    /// The valid settings of a model file.
    pub(super) fn from_file(file: &ModelFile) -> Result<Self, SegmentationError> {
        if file.card.architecture != ARCHITECTURE {
            let path = file.path.clone();
            let found = file.card.architecture.clone();
            return Err(SegmentationError::Architecture { path, found, known: ARCHITECTURE });
        }
        file.expect_version(VERSION)?;
        let settings: Self = file.settings()?;
        settings
            .check()
            .map_err(|error| SegmentationError::Card { path: file.path.clone(), reason: error.to_string() })?;
        Ok(settings)
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
        if let Some(problem) = self.features.problem() {
            return Err(wrong(problem));
        }
        let n_features = self.features.len();
        let inputs = self.network.inputs();
        let outputs = self.network.outputs();
        let [rows, columns] = self.network.multiple_of();
        let rules = [
            Rule::new((64..=8192).contains(&self.columns), format!("columns = {}, must be 64 to 8192", self.columns)),
            Rule::new((1..=16).contains(&self.fold), format!("fold = {}, must be 1 to 16", self.fold)),
            Rule::new(
                self.columns.is_multiple_of(self.fold.max(1) * columns),
                format!("columns = {}, must be a multiple of fold x {columns}", self.columns),
            ),
            Rule::new(
                (1..=MAX_CLASSES).contains(&classes.len()),
                format!("{} classes, must be 1 to {MAX_CLASSES}", classes.len()),
            ),
            Rule::new(rows <= 64, format!("network: rows must be a multiple of {rows}, the limit is 64")),
            Rule::new(
                inputs == self.fold * n_features,
                format!("network.inputs = {inputs}, must be fold x {n_features} features"),
            ),
            Rule::new(
                outputs == self.fold * classes.len(),
                format!("network.outputs = {outputs}, must be fold x {} classes", classes.len()),
            ),
            Rule::new(
                (0.02..=5.0).contains(&self.vote_cell_m),
                format!("vote_cell_m = {}, must be 0.02 to 5", self.vote_cell_m),
            ),
            Rule::for_temperature(self.temperature),
            Rule::new(
                self.nearest.is_none_or(|NearestSettings { k }| (1..=MOST_NEAREST).contains(&k)),
                format!("nearest.k = {}, must be 1 to {MOST_NEAREST}", self.nearest.map_or(0, |nearest| nearest.k)),
            ),
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
    /// The bytes of a model file whose last layer is replaced by examples, one set for each folded column, of which the `k` nearest vote.
    ///
    /// # Errors
    /// If a rule is violated, the number of sets is not `fold`, or the file cannot be encoded.
    pub fn to_bytes_with_examples(
        &self,
        weights: &Weights,
        k: usize,
        examples: &[ColumnExamples],
    ) -> Result<Vec<u8>, SegmentationError> {
        let settings = Self { nearest: Some(NearestSettings { k }), ..self.clone() };
        settings.check()?;
        let n_sets = examples.len();
        check_rules([Rule::new(
            n_sets == self.fold,
            format!("{n_sets} sets of examples, must be fold = {}", self.fold),
        )])?;
        let mut of_examples = Vec::new();
        for (column, examples) in examples.iter().enumerate() {
            of_examples.extend(examples.tensors(column)?);
        }
        let mut tensors = weights.to_tensors()?;
        tensors.extend(of_examples.iter().map(|(name, tensor)| (name.as_str(), tensor.clone())));
        encode_model(ARCHITECTURE, VERSION, &settings, tensors)
    }
}
