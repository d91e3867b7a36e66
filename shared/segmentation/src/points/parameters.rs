//! The parameters of a network on points by name, named and shaped as in `PyTorch`.

use crate::SegmentationError;
use crate::model_file::ModelFile;
use crate::network::{WeightTensor, Weights};
use candle_core::{Device, Tensor, Var};
use random::Random;
use std::collections::BTreeMap;

/// Initial values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// Uniform within 1 / sqrt(inputs of a unit), as `PyTorch` initializes linear layers and convolutions.
    Uniform {
        /// Inputs of a unit.
        inputs: usize,
    },
    /// This value.
    Value(f32),
    /// These values; they are not trained.
    Fixed(Vec<f32>),
    /// This value; batch normalization in training replaces it.
    Statistic(f32),
}

/// A parameter of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Shape.
    pub shape: Vec<usize>,
    /// Initial values.
    pub start: Start,
}

/// Names and shapes of the parameters of a network, in order.
#[derive(Debug, Default)]
pub(super) struct ParameterList(pub Vec<Parameter>);

impl ParameterList {
    pub fn add(&mut self, name: String, shape: &[usize], start: Start) {
        self.0.push(Parameter { name, shape: shape.to_vec(), start });
    }
    /// Weight of this shape, outputs and inputs first, and its bias.
    pub fn layer(&mut self, name: &str, shape: &[usize], bias: bool) {
        let start = Start::Uniform { inputs: shape[1..].iter().product() };
        self.add(format!("{name}.weight"), shape, start.clone());
        if bias {
            self.add(format!("{name}.bias"), &shape[..1], start);
        }
    }
    /// Batch normalization.
    pub fn norm(&mut self, name: &str, channels: usize) {
        self.add(format!("{name}.weight"), &[channels], Start::Value(1.0));
        self.add(format!("{name}.bias"), &[channels], Start::Value(0.0));
        self.add(format!("{name}.running_mean"), &[channels], Start::Statistic(0.0));
        self.add(format!("{name}.running_var"), &[channels], Start::Statistic(1.0));
    }
}

/// Values of the parameters of a network.
#[derive(Clone, Debug, Default)]
pub struct Parameters {
    tensors: BTreeMap<String, Tensor>,
    variables: BTreeMap<String, Var>,
}

impl Parameters {
    /// Creates parameters with values from a function.
    fn from_values(
        list: &[Parameter],
        mut values: impl FnMut(&Parameter) -> Result<Vec<f32>, SegmentationError>,
    ) -> Result<Self, SegmentationError> {
        let mut tensors = BTreeMap::new();
        for parameter in list {
            let tensor = Tensor::from_vec(values(parameter)?, parameter.shape.as_slice(), &Device::Cpu)?;
            tensors.insert(parameter.name.clone(), tensor);
        }
        Ok(Self { tensors, variables: BTreeMap::new() })
    }
    /// Initial values for a training.
    pub fn random(list: &[Parameter], random: &mut Random) -> Result<Self, SegmentationError> {
        Self::from_values(list, |parameter| {
            let n = parameter.shape.iter().product();
            Ok(match &parameter.start {
                Start::Uniform { inputs } => {
                    let limit = 1.0 / (*inputs as f32).sqrt();
                    (0..n).map(|_| random.range(-limit, limit)).collect()
                }
                Start::Value(value) | Start::Statistic(value) => vec![*value; n],
                Start::Fixed(values) => values.clone(),
            })
        })
    }
    /// Reads the parameters from a model file.
    ///
    /// # Errors
    /// If a tensor is missing, has another shape, or has values that are not finite.
    pub fn from_file(list: &[Parameter], file: &ModelFile) -> Result<Self, SegmentationError> {
        Self::from_values(list, |parameter| file.tensor(&parameter.name, &parameter.shape))
    }
    /// The values for a model file.
    ///
    /// # Errors
    /// If candle fails.
    pub fn weights(&self) -> Result<Weights, SegmentationError> {
        let mut weights = Weights::default();
        for (name, tensor) in &self.tensors {
            let values = tensor.flatten_all()?.to_vec1::<f32>()?;
            weights.tensors.insert(name.clone(), WeightTensor { shape: tensor.dims().to_vec(), values });
        }
        Ok(weights)
    }
    /// Replaces the values of parameters whose names and shapes occur in the weights, which may be from another
    /// network. Returns their number.
    ///
    /// # Errors
    /// If candle fails.
    pub fn begin_with(&mut self, weights: &Weights) -> Result<usize, SegmentationError> {
        let mut n_taken = 0;
        for (name, tensor) in &mut self.tensors {
            let Some(taken) = weights.tensors.get(name).filter(|taken| taken.shape == tensor.dims()) else {
                continue;
            };
            let new = Tensor::from_slice(&taken.values, tensor.shape(), &Device::Cpu)?;
            match self.variables.get(name) {
                Some(variable) => variable.set(&new)?,
                None => *tensor = new,
            }
            n_taken += 1;
        }
        Ok(n_taken)
    }
    /// Replaces a value that is not trained: a running statistic.
    ///
    /// # Errors
    /// If the network has no statistic of this name and shape.
    pub fn set_statistic(&mut self, name: &str, value: Tensor) -> Result<(), SegmentationError> {
        let expected = self.get(name)?.dims().to_vec();
        if self.variables.contains_key(name) || value.dims() != expected {
            let found = Some(value.dims().to_vec());
            return Err(SegmentationError::WeightShape { name: name.to_owned(), found, expected });
        }
        self.tensors.insert(name.to_owned(), value);
        Ok(())
    }
    /// Converts the trained parameters to variables: results then have gradients.
    pub fn trainable(mut self, list: &[Parameter]) -> Result<Self, SegmentationError> {
        for parameter in list {
            if matches!(parameter.start, Start::Uniform { .. } | Start::Value(_)) {
                let variable = Var::from_tensor(self.get(&parameter.name)?)?;
                self.tensors.insert(parameter.name.clone(), variable.as_tensor().clone());
                self.variables.insert(parameter.name.clone(), variable);
            }
        }
        Ok(self)
    }
    /// The variables by name, which an optimizer changes.
    pub fn variables(&self) -> &BTreeMap<String, Var> {
        &self.variables
    }
    /// All tensors by name, which a model file contains.
    pub fn tensors(&self) -> &BTreeMap<String, Tensor> {
        &self.tensors
    }
    /// Whether the parameter exists.
    pub(super) fn contains(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }
    /// The tensor of a parameter.
    pub(super) fn get(&self, name: &str) -> Result<&Tensor, SegmentationError> {
        let missing = || SegmentationError::WeightShape { name: name.to_owned(), found: None, expected: Vec::new() };
        self.tensors.get(name).ok_or_else(missing)
    }
    /// Moves the running statistics of batch normalization towards the statistics of a training pass, by `momentum`.
    pub fn update_statistics(
        &mut self,
        statistics: &BTreeMap<String, kernels::points::ColumnStatistics>,
        momentum: f32,
    ) -> Result<(), SegmentationError> {
        for (name, statistics) in statistics {
            // The variance of a population, estimated from a sample.
            let unbiased = statistics.n_rows as f64 / (statistics.n_rows as f64 - 1.0).max(1.0);
            let variances: Vec<f64> = statistics.variances.iter().map(|variance| variance * unbiased).collect();
            for (suffix, new) in [("running_mean", &statistics.means), ("running_var", &variances)] {
                let name = format!("{name}.{suffix}");
                let old = self.get(&name)?.to_vec1::<f32>()?;
                let moved = old.iter().zip(new).map(|(old, new)| old + momentum * (*new as f32 - old));
                let moved: Vec<f32> = moved.collect();
                self.tensors.insert(name, Tensor::from_slice(&moved, moved.len(), &Device::Cpu)?);
            }
        }
        Ok(())
    }
}
