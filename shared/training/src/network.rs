//! The interface between the training loop and a network.

use crate::TrainingError;
use crate::criterion::Criterion;
use candle_core::{Tensor, Var};
use random::Random;
use segmentation::network::Weights;
use serde::{Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;

/// Loss of a batch, and its derivatives with respect to the variables by name.
pub struct Derivatives {
    /// Loss.
    pub loss: f64,
    /// Derivatives by the name of the variable.
    pub gradients: BTreeMap<String, Vec<f32>>,
}

/// Logits of the labeled rows of a batch: pixels or points.
pub struct LabeledLogits {
    /// A row for each labeled pixel or point, a column for each class.
    pub logits: Tensor,
    /// The classes of the rows.
    pub classes: Vec<u8>,
}

/// The logits of a batch; `None` if nothing is labeled.
pub type LabeledLogitsResult = Result<Option<LabeledLogits>, TrainingError>;

/// A network in training.
pub trait Network: Sized + Sync {
    /// A labeled input.
    type Example: Send + Sync;
    /// The architecture; checkpoints compare it.
    type Spec: Clone + PartialEq + Serialize + DeserializeOwned;

    /// The architecture.
    fn spec(&self) -> &Self::Spec;
    /// The variables that the optimizer changes, by name.
    fn variables(&self) -> &BTreeMap<String, Var>;
    /// Running statistics by name: values that batches update, without derivatives.
    fn statistics(&self) -> BTreeMap<String, Tensor> {
        BTreeMap::new()
    }
    /// Makes the statistics constants from now on, in training as in prediction.
    fn fix_statistics(&mut self) {}
    /// Replaces one of the statistics.
    fn set_statistic(&mut self, name: &str, value: Tensor) -> Result<(), TrainingError>;
    /// A deep copy with its own variables.
    fn copied(&self) -> Result<Self, TrainingError>;
    /// The weights for a model file.
    fn weights(&self) -> Result<Weights, TrainingError>;
    /// A network of the same architecture with these weights.
    fn with_weights(&self, weights: &Weights) -> Result<Self, TrainingError>;
    /// Loss of a batch and its derivatives; `None` if nothing is labeled. May change the statistics.
    fn derive(
        &mut self,
        batch: &[Self::Example],
        criterion: &Criterion,
        random: Random,
    ) -> Result<Option<Derivatives>, TrainingError>;
    /// A function for the logits of batches.
    fn evaluator(&self, n_classes: usize) -> Result<impl Fn(&[Self::Example]) -> LabeledLogitsResult, TrainingError>;
}

/// Moves all values towards the values of another network of the same architecture, by a share of their difference.
pub(crate) fn move_to<N: Network>(network: &mut N, other: &N, share: f64) -> Result<(), TrainingError> {
    let moved = |from: &Tensor, to: &Tensor| from.affine(1.0 - share, 0.0)? + to.affine(share, 0.0)?;
    for (variable, to) in network.variables().values().zip(other.variables().values()) {
        variable.set(&moved(variable, to)?)?;
    }
    let to = other.statistics();
    for (name, from) in network.statistics() {
        network.set_statistic(&name, moved(&from, &to[&name])?)?;
    }
    Ok(())
}

/// All values by name: variables and statistics.
pub(crate) fn values(network: &impl Network) -> BTreeMap<String, Tensor> {
    let mut values = network.statistics();
    values.extend(network.variables().iter().map(|(name, var)| (name.clone(), var.as_tensor().clone())));
    values
}
