//! Networks on points in training: candle differentiates the operations of `segmentation::points`.

use crate::criterion::{Criterion, RowDerivatives, known_rows};
use crate::network::{Derivatives, LabeledLogits, LabeledLogitsResult, Network};
use crate::{PointExample, TrainingError};
use candle_core::{Device, Tensor, Var};
use random::Random;
use segmentation::SegmentationError;
use segmentation::network::Weights;
use segmentation::points::{Parameter, Parameters, Pass, PointBatch, PointNetworkSpec, Start};
use std::collections::BTreeMap;

/// Share by which a step moves the running statistics of batch normalization, as in `PyTorch`.
const MOMENTUM: f32 = 0.1;

/// Factor in the loss of the deviation of `PointNet` transforms from orthogonal ones, as published.
const REGULARIZATION: f64 = 1e-3;

/// A network on points.
pub struct PointNetwork {
    spec: PointNetworkSpec,
    parameters: Parameters,
    /// Names of the running statistics.
    statistics: Vec<String>,
    has_fixed_statistics: bool,
}

impl PointNetwork {
    /// Random parameters from a seed.
    ///
    /// # Errors
    /// If candle fails.
    pub fn random(spec: &PointNetworkSpec, seed: u64) -> Result<Self, TrainingError> {
        let list = spec.parameters();
        let parameters = Parameters::random(&list, &mut Random::new(seed))?.trainable(&list)?;
        let is_statistic = |parameter: &Parameter| matches!(parameter.start, Start::Statistic(_));
        let statistics = list.into_iter().filter(is_statistic).map(|parameter| parameter.name).collect();
        Ok(Self { spec: spec.clone(), parameters, statistics, has_fixed_statistics: false })
    }
    /// Takes the parameters whose names and shapes occur in the weights. Returns the number of parameters taken.
    ///
    /// # Errors
    /// If candle fails.
    pub fn begin_with(&mut self, weights: &Weights) -> Result<usize, TrainingError> {
        Ok(self.parameters.begin_with(weights)?)
    }
    /// Number of tensors of parameters.
    pub fn n_tensors(&self) -> usize {
        self.parameters.tensors().len()
    }
    /// The scores of a batch.
    fn run(&self, pass: &mut Pass<'_>, batch: &[&PointExample], seed: u64) -> Result<Tensor, TrainingError> {
        let positions = batch.iter().flat_map(|example| example.positions.iter().copied()).collect();
        let lengths = batch.iter().map(|example| example.positions.len()).collect();
        let features: Vec<f32> = batch.iter().flat_map(|example| example.features.iter().copied()).collect();
        let plan = self.spec.plan(PointBatch::new(positions, lengths)?, seed)?;
        let n_inputs = self.spec.inputs();
        let features = Tensor::from_vec(features, (plan.n_points(), n_inputs), &Device::Cpu)?;
        Ok(self.spec.run(pass, &plan, &features)?)
    }
}

/// The examples of a batch that the network can process.
struct Usable<'a> {
    examples: Vec<&'a PointExample>,
    /// Classes of their points.
    truth: Vec<u8>,
}

fn usable(batch: &[PointExample]) -> Usable<'_> {
    // A single point has no neighbors.
    let examples: Vec<&PointExample> = batch.iter().filter(|example| example.positions.len() > 1).collect();
    let truth = examples.iter().flat_map(|example| example.truth.iter().copied()).collect();
    Usable { examples, truth }
}

/// Rows of a tensor.
fn rows_of(values: &[f32], n_columns: usize, rows: &[u32]) -> Vec<f32> {
    rows.iter().flat_map(|row| &values[*row as usize * n_columns..][..n_columns]).copied().collect()
}

impl Network for PointNetwork {
    type Example = PointExample;
    type Spec = PointNetworkSpec;

    fn spec(&self) -> &PointNetworkSpec {
        &self.spec
    }
    fn variables(&self) -> &BTreeMap<String, Var> {
        self.parameters.variables()
    }
    fn statistics(&self) -> BTreeMap<String, Tensor> {
        let tensors = self.parameters.tensors();
        self.statistics.iter().map(|name| (name.clone(), tensors[name].clone())).collect()
    }
    fn fix_statistics(&mut self) {
        self.has_fixed_statistics = true;
    }
    fn set_statistic(&mut self, name: &str, value: Tensor) -> Result<(), TrainingError> {
        Ok(self.parameters.set_statistic(name, value)?)
    }
    fn copied(&self) -> Result<Self, TrainingError> {
        self.with_weights(&self.weights()?)
    }
    fn weights(&self) -> Result<Weights, TrainingError> {
        Ok(self.parameters.weights()?)
    }
    fn with_weights(&self, weights: &Weights) -> Result<Self, TrainingError> {
        let mut network = Self::random(&self.spec, 0)?;
        network.begin_with(weights)?;
        Ok(network)
    }
    fn derive(
        &mut self,
        batch: &[PointExample],
        criterion: &Criterion,
        mut random: Random,
    ) -> Result<Option<Derivatives>, TrainingError> {
        let Usable { examples, truth } = usable(batch);
        let known = criterion.known_rows(&truth, &mut random);
        if known.is_empty() {
            return Ok(None);
        }
        let seed = random.bits();
        let pass = if self.has_fixed_statistics { Pass::training_with_running_statistics } else { Pass::training };
        let mut pass = pass(&self.parameters, random);
        let scores = match self.run(&mut pass, &examples, seed) {
            // Spheres of a few points become one point on a coarse level, which has no statistics.
            Err(TrainingError::Segmentation(SegmentationError::TooFewRows { .. })) => return Ok(None),
            scores => scores?,
        };
        let n_classes = criterion.n_classes;
        let logits = rows_of(&scores.flatten_all()?.to_vec1::<f32>()?, n_classes, &known);
        let classes: Vec<u8> = known.iter().map(|&point| truth[point as usize]).collect();
        let RowDerivatives { loss, by_logits } = criterion.derive_rows(logits, &classes)?;
        let mut by_scores = vec![0.0; truth.len() * n_classes];
        for (values, &point) in by_logits.chunks_exact(n_classes).zip(&known) {
            by_scores[point as usize * n_classes..][..n_classes].copy_from_slice(values);
        }
        // A sum weighted with the derivatives of the loss, so that candle differentiates the network.
        let mut sum = (&scores * Tensor::from_vec(by_scores, scores.shape(), &Device::Cpu)?)?.sum_all()?;
        if let Some(term) = pass.regularization() {
            sum = (sum + (term * REGULARIZATION)?.sum_all()?)?;
        }
        let derived = sum.backward()?;
        let mut gradients = BTreeMap::new();
        for (name, var) in self.parameters.variables() {
            let gradient = match derived.get(var) {
                Some(gradient) => gradient.flatten_all()?.to_vec1::<f32>()?,
                None => vec![0.0; var.elem_count()],
            };
            gradients.insert(name.clone(), gradient);
        }
        let statistics = pass.statistics().clone();
        self.parameters.update_statistics(&statistics, MOMENTUM)?;
        Ok(Some(Derivatives { loss, gradients }))
    }
    fn evaluator(&self, n_classes: usize) -> Result<impl Fn(&[PointExample]) -> LabeledLogitsResult, TrainingError> {
        Ok(move |batch: &[PointExample]| {
            let Usable { examples, truth } = usable(batch);
            let known = known_rows(&truth);
            if known.is_empty() {
                return Ok(None);
            }
            let scores = self.run(&mut Pass::evaluation(&self.parameters), &examples, 0)?;
            let logits = rows_of(&scores.flatten_all()?.to_vec1::<f32>()?, n_classes, &known);
            let logits = Tensor::from_vec(logits, (known.len(), n_classes), &Device::Cpu)?;
            let classes = known.iter().map(|&point| truth[point as usize]).collect();
            Ok(Some(LabeledLogits { logits, classes }))
        })
    }
}
