//! The weights of a network by name, named and ordered as by `PyTorch`.

use super::layer::Layer;
use super::spec::NetworkSpec;
use crate::SegmentationError;
use crate::model_file::ModelFile;
use candle_core::{Device, Tensor};
use kernels::images::Filter;
use std::collections::BTreeMap;

/// Weights `<layer>.weight` `[out, in, rows, columns]` and biases `<layer>.bias` `[out]` of every layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// Shape and values by name.
    pub tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Weights {
    /// Reads the weights of a network from a model file.
    ///
    /// # Errors
    /// If a tensor is missing or invalid.
    pub fn from_file(spec: &NetworkSpec, file: &ModelFile) -> Result<Self, SegmentationError> {
        let mut tensors = BTreeMap::new();
        for layer in spec.layers() {
            for (name, shape) in layer.tensors() {
                let values = file.tensor(&name, &shape)?;
                tensors.insert(name, (shape, values));
            }
        }
        Ok(Self { tensors })
    }
    /// The weights `share` of the way from these to `other` ones of the same network.
    #[must_use]
    pub fn mixed_with(&self, other: &Self, share: f32) -> Self {
        let mut mixed = self.clone();
        for ((_, values), (_, others)) in mixed.tensors.values_mut().zip(other.tensors.values()) {
            values.iter_mut().zip(others).for_each(|(value, other)| *value += share * (other - *value));
        }
        mixed
    }
    pub(crate) fn to_tensors(&self) -> Result<BTreeMap<&str, Tensor>, SegmentationError> {
        let tensor =
            |(shape, values): &(Vec<usize>, Vec<f32>)| Tensor::from_slice(values, shape.as_slice(), &Device::Cpu);
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
            for (name, shape) in layer.tensors() {
                match self.tensors.get(&name) {
                    Some((of, values)) if *of == shape => found.push(values),
                    other => {
                        let found = other.map(|(of, _)| of.clone());
                        return Err(SegmentationError::WeightShape { name, found, expected: shape });
                    }
                }
            }
            Ok(Filter::new(layer.shape.clone(), found[0], found[1]))
        };
        spec.layers().iter().map(of_layer).collect()
    }
}
