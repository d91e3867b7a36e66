//! Checkpoints: a resumed training gives the same bytes as an uninterrupted one.

use super::{TrainSettings, Trainer};
use crate::TrainingError;
use crate::curves::Curves;
use crate::network::{Network, values};
use candle_core::{Device, Tensor};
use segmentation::network::{WeightTensor, Weights};
use segmentation::{ModelFile, encode_model};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

const ARCHITECTURE: &str = "checkpoint";
const VERSION: u32 = 2;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State<S> {
    settings: TrainSettings,
    network: S,
    steps: u64,
    curves: Curves,
}

impl<N: Network> Trainer<N> {
    /// The bytes of a checkpoint after the last epoch.
    ///
    /// # Errors
    /// If the file cannot be encoded.
    pub fn checkpoint(&self) -> Result<Vec<u8>, TrainingError> {
        let mut tensors: BTreeMap<String, Tensor> = BTreeMap::new();
        for (kind, network) in [("variable", &self.network), ("averaged", &self.averaged)] {
            tensors.extend(values(network).into_iter().map(|(name, value)| (format!("{kind}.{name}"), value)));
        }
        for (name, var) in self.network.variables() {
            if let Some(means) = self.adam.means.get(name) {
                for (kind, values) in ["mean", "square"].into_iter().zip(means) {
                    tensors.insert(format!("{kind}.{name}"), Tensor::from_slice(values, var.shape(), &Device::Cpu)?);
                }
            }
        }
        for (name, WeightTensor { shape, values }) in &self.best.tensors {
            tensors.insert(format!("best.{name}"), Tensor::from_slice(values, shape.as_slice(), &Device::Cpu)?);
        }
        let state = State {
            settings: self.settings.clone(),
            network: self.network.spec().clone(),
            steps: self.adam.steps,
            curves: self.curves.clone(),
        };
        let borrowed = tensors.iter().map(|(name, tensor)| (name.as_str(), tensor.clone())).collect();
        Ok(encode_model(ARCHITECTURE, VERSION, &state, borrowed)?)
    }

    /// Continues from a checkpoint of the same network and the same settings. Only `epochs` and `patience` may differ: a
    /// finished training continues with the learning rate that a training of `epochs` has at this step.
    ///
    /// # Errors
    /// If the file is not a complete checkpoint, or belongs to other settings or another network.
    pub fn resume(&mut self, path: &Path) -> Result<(), TrainingError> {
        let file = ModelFile::read(path)?;
        file.expect_version(VERSION)?;
        let wrong = |reason| TrainingError::Checkpoint { path: path.into(), reason };
        if file.card.architecture != ARCHITECTURE {
            return Err(wrong("this file is a model, not a checkpoint"));
        }
        let state: State<N::Spec> = file.settings()?;
        let epochs = self.settings.epochs;
        let patience = self.settings.patience;
        if (TrainSettings { epochs, patience, ..state.settings }) != self.settings
            || &state.network != self.network.spec()
        {
            return Err(wrong("checkpoint of another recipe; train into another folder, or remove the file"));
        }
        let mut means = BTreeMap::new();
        for (kind, network) in [("variable", &mut self.network), ("averaged", &mut self.averaged)] {
            let read = |name: &str, of: &Tensor| -> Result<Tensor, TrainingError> {
                let values = file.tensor(&format!("{kind}.{name}"), of.dims())?;
                Ok(Tensor::from_vec(values, of.shape(), &Device::Cpu)?)
            };
            for (name, var) in network.variables() {
                var.set(&read(name, var)?)?;
            }
            for (name, statistic) in network.statistics() {
                network.set_statistic(&name, read(&name, &statistic)?)?;
            }
        }
        for (name, var) in self.network.variables() {
            if state.steps > 0 && !self.frozen.iter().any(|prefix| name.starts_with(prefix)) {
                let [mean, square] = ["mean", "square"].map(|kind| file.tensor(&format!("{kind}.{name}"), var.dims()));
                means.insert(name.clone(), [mean?, square?]);
            }
        }
        let mut best = Weights::default();
        for (name, WeightTensor { shape, .. }) in &self.best.tensors {
            let values = file.tensor(&format!("best.{name}"), shape)?;
            best.tensors.insert(name.clone(), WeightTensor { shape: shape.clone(), values });
        }
        self.best = best;
        self.curves = state.curves;
        self.adam.steps = state.steps;
        self.adam.means = means;
        Ok(())
    }
}
