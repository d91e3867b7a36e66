//! The weights of a network by name, named and ordered as in `PyTorch`.

use super::layer::{Layer, TensorShape};
use super::spec::NetworkSpec;
use crate::SegmentationError;
use crate::model_file::ModelFile;
use candle_core::{Device, Tensor};
use kernels::images::Filter;
use std::collections::BTreeMap;

/// Shape and values of a tensor, as in `PyTorch`.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightTensor {
    /// Dimensions, outermost first.
    pub shape: Vec<usize>,
    /// Values in this order, the last dimension innermost.
    pub values: Vec<f32>,
}

/// Weights `<layer>.weight` `[out, in, rows, columns]` and biases `<layer>.bias` `[out]` of every layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// The tensors by name.
    pub tensors: BTreeMap<String, WeightTensor>,
}

impl Weights {
    /// Reads the weights of a network from a model file.
    ///
    /// # Errors
    /// If a tensor is missing or invalid.
    pub fn from_file(spec: &NetworkSpec, file: &ModelFile) -> Result<Self, SegmentationError> {
        let mut tensors = BTreeMap::new();
        for layer in spec.layers() {
            for TensorShape { name, shape } in layer.tensors() {
                let values = file.tensor(&name, &shape)?;
                tensors.insert(name, WeightTensor { shape, values });
            }
        }
        Ok(Self { tensors })
    }
    /// Linear interpolation to `other` weights of the same network: `share` 0 gives these weights, 1 the other ones.
    #[must_use]
    pub fn mixed_with(&self, other: &Self, share: f32) -> Self {
        let mut mixed = self.clone();
        for (tensor, other) in mixed.tensors.values_mut().zip(other.tensors.values()) {
            tensor.values.iter_mut().zip(&other.values).for_each(|(value, other)| *value += share * (other - *value));
        }
        mixed
    }
    pub(crate) fn to_tensors(&self) -> Result<BTreeMap<&str, Tensor>, SegmentationError> {
        let tensor = |of: &WeightTensor| Tensor::from_slice(&of.values, of.shape.as_slice(), &Device::Cpu);
        let pairs = self.tensors.iter().map(|(name, of)| Ok((name.as_str(), tensor(of)?)));
        pairs.collect()
    }
    /// The packed filters of the layers, in order.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape.
    pub fn filters(&self, spec: &NetworkSpec) -> Result<Vec<Filter>, SegmentationError> {
        let of_layer = |layer: &Layer| {
            let mut found = Vec::new();
            for TensorShape { name, shape } in layer.tensors() {
                match self.tensors.get(&name) {
                    Some(tensor) if tensor.shape == shape => found.push(&tensor.values),
                    other => {
                        let found = other.map(|tensor| tensor.shape.clone());
                        return Err(SegmentationError::WeightShape { name, found, expected: shape });
                    }
                }
            }
            Ok(Filter::new(layer.shape.clone(), found[0], found[1]))
        };
        spec.layers().iter().map(of_layer).collect()
    }
}
