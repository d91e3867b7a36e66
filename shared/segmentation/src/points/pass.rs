//! One pass of a network over a batch, for evaluation or training.

use super::parameters::Parameters;
use crate::SegmentationError;
use candle_core::{Device, Tensor};
use kernels::points::{Activation, ColumnStatistics, Normalization, Source, linear, normalize};
use random::Random;
use std::collections::BTreeMap;

/// Added to variances in batch normalization.
const EPSILON: f64 = 1e-5;

/// Applies the layers of a network.
///
/// In evaluation, batch normalization uses the running statistics and is merged into the adjacent layer; there are no
/// gradients. In training it uses the statistics of the batch, which the pass keeps for
/// [`Parameters::update_statistics`], or the running ones as constants.
pub struct Pass<'a> {
    parameters: &'a Parameters,
    /// Random numbers of dropout; `None` in evaluation.
    training: Option<Random>,
    /// Whether batch normalization uses the statistics of the batch.
    of_batch: bool,
    statistics: BTreeMap<String, ColumnStatistics>,
    regularization: Option<Tensor>,
}

impl<'a> Pass<'a> {
    /// A pass for prediction.
    pub fn evaluation(parameters: &'a Parameters) -> Self {
        Self { parameters, training: None, of_batch: false, statistics: BTreeMap::new(), regularization: None }
    }
    /// A pass for training, with the statistics of the batch.
    pub fn training(parameters: &'a Parameters, random: Random) -> Self {
        Self { of_batch: true, ..Self::training_with_running_statistics(parameters, random) }
    }
    /// A pass for training with the running statistics, as in prediction.
    pub fn training_with_running_statistics(parameters: &'a Parameters, random: Random) -> Self {
        Self { training: Some(random), ..Self::evaluation(parameters) }
    }
    /// Whether this is a training pass.
    pub(super) fn is_training(&self) -> bool {
        self.training.is_some()
    }
    /// Statistics of the batch by the name of the normalization; empty if the pass uses the running ones.
    pub fn statistics(&self) -> &BTreeMap<String, ColumnStatistics> {
        &self.statistics
    }
    /// A term for the loss, if the network has one: the distance of `PointNet`'s transforms to orthogonal ones.
    pub fn regularization(&self) -> Option<&Tensor> {
        self.regularization.as_ref()
    }
    /// Adds a term for the loss.
    pub(super) fn regularize(&mut self, term: Tensor) -> Result<(), SegmentationError> {
        self.regularization = Some(match self.regularization.take() {
            Some(sum) => (sum + term)?,
            None => term,
        });
        Ok(())
    }
    /// A parameter.
    pub(super) fn get(&self, name: &str) -> Result<&'a Tensor, SegmentationError> {
        self.parameters.get(name)
    }
    /// The weight of a linear layer or of a convolution with one tap: `(out, in)`.
    pub(super) fn matrix(&self, name: &str) -> Result<Tensor, SegmentationError> {
        Ok(self.get(&format!("{name}.weight"))?.flatten_from(1)?)
    }
    /// The bias of a layer; zeros if the layer has no bias.
    pub(super) fn bias(&self, name: &str, channels: usize) -> Result<Tensor, SegmentationError> {
        let name = format!("{name}.bias");
        if self.parameters.contains(&name) { Ok(self.get(&name)?.clone()) } else { zeros(channels) }
    }
    /// A linear layer.
    pub(super) fn linear(
        &self,
        rows: &Tensor,
        name: &str,
        activation: Activation,
    ) -> Result<Tensor, SegmentationError> {
        let weight = self.matrix(name)?;
        Ok(linear(rows, &weight, &self.bias(name, weight.dim(0)?)?, activation)?)
    }
    /// A linear layer, batch normalization, and an activation.
    pub(super) fn linear_norm(
        &mut self,
        rows: &Tensor,
        name: &str,
        norm: &str,
        activation: Activation,
    ) -> Result<Tensor, SegmentationError> {
        let weight = self.matrix(name)?;
        let bias = self.bias(name, weight.dim(0)?)?;
        if self.is_training() {
            return self.norm(&linear(rows, &weight, &bias, Activation::NONE)?, norm, activation);
        }
        let LinearLayer { weight, bias } = self.running(norm)?.after(&weight, &bias)?;
        Ok(linear(rows, &weight, &bias, activation)?)
    }
    /// Batch normalization with the running statistics.
    pub(super) fn running(&self, norm: &str) -> Result<RunningNorm, SegmentationError> {
        let of = |suffix: &str| self.get(&format!("{norm}.{suffix}"));
        let scale = (of("weight")? / (of("running_var")? + EPSILON)?.sqrt()?)?;
        let shift = (of("bias")? - (of("running_mean")? * &scale)?)?;
        Ok(RunningNorm { scale, shift })
    }
    /// Batch normalization and an activation.
    pub(super) fn norm(
        &mut self,
        rows: &Tensor,
        name: &str,
        activation: Activation,
    ) -> Result<Tensor, SegmentationError> {
        let of = |suffix: &str| self.get(&format!("{name}.{suffix}"));
        let weight = of("weight")?;
        let bias = of("bias")?;
        if !self.of_batch {
            let values = |suffix: &str| -> Result<Vec<f64>, SegmentationError> {
                Ok(of(suffix)?.to_vec1::<f32>()?.into_iter().map(f64::from).collect())
            };
            let means = values("running_mean")?;
            let variances = values("running_var")?;
            let running = ColumnStatistics { n_rows: 0, means, variances };
            let by = Normalization { statistics: &running, source: Source::Constant, epsilon: EPSILON };
            return Ok(normalize(rows, by, weight, bias, activation)?);
        }
        let statistics = ColumnStatistics::from_rows(rows)?;
        if statistics.n_rows < 2 {
            return Err(SegmentationError::TooFewRows { name: name.to_owned() });
        }
        let by = Normalization { statistics: &statistics, source: Source::Rows, epsilon: EPSILON };
        let out = normalize(rows, by, weight, bias, activation)?;
        self.statistics.insert(name.to_owned(), statistics);
        Ok(out)
    }
    /// Dropout: in training, sets a share of the values to zero and scales the others to keep the mean.
    pub(super) fn dropout(&mut self, rows: Tensor, rate: f32) -> Result<Tensor, SegmentationError> {
        let Some(random) = &mut self.training else { return Ok(rows) };
        if rate <= 0.0 {
            return Ok(rows);
        }
        let kept = 1.0 / (1.0 - rate);
        let mask: Vec<f32> = (0..rows.elem_count()).map(|_| if random.chance(rate) { 0.0 } else { kept }).collect();
        Ok((&rows * Tensor::from_vec(mask, rows.shape(), &Device::Cpu)?)?)
    }
}

/// Batch normalization in evaluation: `scale * x + shift`.
pub(super) struct RunningNorm {
    pub scale: Tensor,
    pub shift: Tensor,
}

/// The tensors of a linear layer.
pub(super) struct LinearLayer {
    /// Weights, `(out, in)`.
    pub weight: Tensor,
    /// Biases, `(out)`.
    pub bias: Tensor,
}

impl RunningNorm {
    /// Merges a linear layer and the normalization after it.
    pub fn after(&self, weight: &Tensor, bias: &Tensor) -> Result<LinearLayer, SegmentationError> {
        let bias = ((bias * &self.scale)? + &self.shift)?;
        Ok(LinearLayer { weight: weight.broadcast_mul(&self.scale.unsqueeze(1)?)?, bias })
    }
    /// Merges a linear layer and the normalization before it.
    pub fn before(&self, weight: &Tensor, bias: &Tensor) -> Result<LinearLayer, SegmentationError> {
        let bias = (weight.matmul(&self.shift.unsqueeze(1)?)?.flatten_all()? + bias)?;
        Ok(LinearLayer { weight: weight.broadcast_mul(&self.scale.unsqueeze(0)?)?, bias })
    }
}

/// A bias of zeros.
pub(super) fn zeros(channels: usize) -> Result<Tensor, SegmentationError> {
    Ok(Tensor::zeros(channels, candle_core::DType::F32, &Device::Cpu)?)
}
