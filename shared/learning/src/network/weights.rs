//! The numbers of a network, by name, as `PyTorch` names and orders them.

use super::{Layer, NetworkSpec};
use crate::LearningError;
use crate::engine::Filter;
use crate::model_file::ModelFile;
use candle_core::{Device, Tensor};
use std::collections::BTreeMap;

/// Weights `<layer>.weight` `[out, in, rows, columns]` and biases `<layer>.bias` `[out]` of every layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// Shape and numbers by name.
    pub tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Weights {
    pub(crate) fn from_file(spec: &NetworkSpec, file: &ModelFile) -> Result<Self, LearningError> {
        let mut tensors = BTreeMap::new();
        for layer in spec.layers() {
            for (name, shape) in tensors_of(&layer) {
                let values = file.tensor(&name, &shape)?;
                tensors.insert(name, (shape, values));
            }
        }
        Ok(Self { tensors })
    }
    pub(crate) fn to_tensors(&self) -> Result<BTreeMap<&str, Tensor>, LearningError> {
        let tensor =
            |(shape, values): &(Vec<usize>, Vec<f32>)| Tensor::from_slice(values, shape.as_slice(), &Device::Cpu);
        let pairs = self.tensors.iter().map(|(name, of)| Ok((name.as_str(), tensor(of)?)));
        pairs.collect()
    }
    /// The packed filters of a network's layers, in order.
    ///
    /// # Errors
    /// If a tensor is absent or of another shape.
    pub fn filters(&self, spec: &NetworkSpec) -> Result<Vec<Filter>, LearningError> {
        let of_layer = |layer: &Layer| {
            let mut found = Vec::new();
            for (name, shape) in tensors_of(layer) {
                match self.tensors.get(&name) {
                    Some((got, values)) if *got == shape => found.push(values),
                    other => {
                        let got = other.map(|(got, _)| got);
                        let reason = format!("tensor `{name}` has shape {got:?}, the network needs {shape:?}");
                        return Err(LearningError::Compute(candle_core::Error::Msg(reason)));
                    }
                }
            }
            Ok(Filter::new(layer.shape.clone(), found[0], found[1]))
        };
        spec.layers().iter().map(of_layer).collect()
    }
}

/// Names and shapes of a layer's tensors.
pub(super) fn tensors_of(layer: &Layer) -> [(String, Vec<usize>); 2] {
    let shape = &layer.shape;
    let n_in = shape.in_channels.iter().sum();
    let weight = vec![shape.out_channels, n_in, shape.kernel[0], shape.kernel[1]];
    [(format!("{}.weight", layer.name), weight), (format!("{}.bias", layer.name), vec![shape.out_channels])]
}
