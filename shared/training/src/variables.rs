//! The variables of a training.

use crate::TrainingError;
use candle_core::{Device, Tensor, Var};
use kernels::images::PlainFilter;
use random::Random;
use segmentation::network::{Layer, NetworkSpec, WeightTensor, Weights};
use std::collections::BTreeMap;

/// Gain of standardized weights before a rectifier: sqrt(2 / (1 - 1 / pi)) keeps the variance constant from layer to
/// layer (Brock et al. 2021).
const GAIN: f32 = 1.713_858;

/// Added to the variance of the weights of a filter.
const MIN_VARIANCE: f64 = 1e-8;

/// The variables of a training. Filters are standardized: `<layer>.weight` is `<layer>.raw`, shifted and scaled to mean 0 and
/// variance 1 / (inputs of the filter), times `<layer>.gain` of its output channel. This stabilizes training like batch
/// normalization, without statistics of the batch, and gives plain convolutions after training.
pub struct Variables {
    spec: NetworkSpec,
    vars: BTreeMap<String, Var>,
}

impl Variables {
    /// Random variables from a seed.
    ///
    /// # Errors
    /// If candle fails.
    pub fn random(spec: &NetworkSpec, seed: u64) -> Result<Self, TrainingError> {
        let mut vars = BTreeMap::new();
        for (stream, layer) in spec.layers().iter().enumerate() {
            let mut random = Random::for_stream(seed, stream as u64);
            let [weight, bias] = layer.tensors();
            let gain = if layer.shape.rectify { GAIN } else { 1.0 };
            // They have the norm of standardized filters, so that a step of Adam rotates new and trained filters equally.
            let fan_in = weight.shape[1..].iter().product::<usize>() as f32;
            let scale = gain / fan_in.sqrt();
            let raw: Vec<f32> = (0..weight.shape.iter().product()).map(|_| scale * random.gauss()).collect();
            let mut insert = |name: String, values: Vec<f32>, shape: &[usize]| -> Result<(), TrainingError> {
                let tensor = Tensor::from_vec(values, shape, &Device::Cpu)?;
                vars.insert(name, Var::from_tensor(&tensor)?);
                Ok(())
            };
            insert(format!("{}.raw", layer.name), raw, &weight.shape)?;
            insert(format!("{}.gain", layer.name), vec![gain; bias.shape[0]], &bias.shape)?;
            insert(bias.name, vec![0.0; bias.shape[0]], &bias.shape)?;
        }
        Ok(Self { spec: spec.clone(), vars })
    }
    /// Variables whose standardized filters equal these weights, for fine-tuning.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape, or the mean of a filter is not zero. All filters trained here have
    /// zero mean.
    pub fn from_weights(spec: &NetworkSpec, weights: &Weights) -> Result<Self, TrainingError> {
        weights.filters(spec)?;
        let variables = Self::random(spec, 0)?;
        variables.begin_with(weights)?;
        Ok(variables)
    }
    /// Initializes the layers whose names and shapes occur in the weights. The weights may come from another network with
    /// the same classes; for other classes see [`crate::match_classes`]. Returns the number of initialized layers.
    ///
    /// # Errors
    /// If the mean of a filter is not zero. All filters trained here have zero mean.
    pub fn begin_with(&self, weights: &Weights) -> Result<usize, TrainingError> {
        let mut n_taken = 0;
        for layer in self.spec.layers() {
            let [weight, bias] = layer.tensors();
            let taken = weights.tensors.get(&weight.name).filter(|taken| taken.shape == weight.shape);
            let Some(WeightTensor { values, .. }) = taken else { continue };
            let fan_in = values.len() / bias.shape[0];
            let gains = values.chunks_exact(fan_in).map(|filter| {
                let mean = filter.iter().sum::<f32>() / fan_in as f32;
                let variance = filter.iter().map(|w| (w - mean).powi(2)).sum::<f32>() / fan_in as f32;
                (variance * fan_in as f32).sqrt()
            });
            let gains: Vec<f32> = gains.collect();
            let mean = |filter: &[f32]| filter.iter().sum::<f32>() / fan_in as f32;
            let is_shifted = |(filter, gain): (&[f32], &f32)| mean(filter).abs() * fan_in as f32 > 1e-2 * gain + 1e-6;
            if fan_in > 1 && values.chunks_exact(fan_in).zip(&gains).any(is_shifted) {
                return Err(TrainingError::NotStandardized { name: weight.name });
            }
            self.set(&format!("{}.raw", layer.name), values.clone(), &weight.shape)?;
            self.set(&format!("{}.gain", layer.name), gains, &bias.shape)?;
            self.set(&bias.name, weights.tensors[&bias.name].values.clone(), &bias.shape)?;
            n_taken += 1;
        }
        Ok(n_taken)
    }
    /// Sets the values of a variable.
    ///
    /// # Errors
    /// If it does not exist or has another shape.
    pub fn set(&self, name: &str, values: Vec<f32>, shape: &[usize]) -> Result<(), TrainingError> {
        let var = self.vars.get(name);
        let var = var.ok_or_else(|| TrainingError::NoVariable { name: name.to_owned() })?;
        Ok(var.set(&Tensor::from_vec(values, shape, &Device::Cpu)?)?)
    }
    /// A deep copy.
    ///
    /// # Errors
    /// If candle fails.
    pub fn copied(&self) -> Result<Self, TrainingError> {
        let copied = |(name, var): (&String, &Var)| Ok((name.clone(), Var::from_tensor(&var.copy()?)?));
        let vars = self.vars.iter().map(copied).collect::<Result<_, TrainingError>>()?;
        Ok(Self { spec: self.spec.clone(), vars })
    }
    /// The variables by name.
    pub(crate) fn by_name(&self) -> &BTreeMap<String, Var> {
        &self.vars
    }
    /// Names and variables, in the order of the names.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.vars.iter().map(|(name, var)| (name.as_str(), var))
    }
    /// Architecture of the network.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// Raw filters of a layer, one after the other, and their gains.
    fn raw_and_gains(&self, layer: &Layer) -> Result<[Vec<f32>; 2], TrainingError> {
        let [raw, gains] = ["raw", "gain"].map(|kind| &self.vars[&format!("{}.{kind}", layer.name)]);
        Ok([raw.flatten_all()?.to_vec1()?, gains.to_vec1()?])
    }
    /// The current standardized filters and biases.
    ///
    /// # Errors
    /// If candle fails.
    pub fn weights(&self) -> Result<Weights, TrainingError> {
        let mut weights = Weights::default();
        for layer in self.spec.layers() {
            let [weight, bias] = layer.tensors();
            let [mut values, gains] = self.raw_and_gains(&layer)?;
            let fan_in = values.len() / gains.len();
            for (filter, gain) in values.chunks_exact_mut(fan_in).zip(gains) {
                let norm = center(filter);
                for value in filter {
                    *value *= gain / norm;
                }
            }
            weights.tensors.insert(weight.name, WeightTensor { shape: weight.shape, values });
            let values = self.vars[&bias.name].to_vec1::<f32>()?;
            weights.tensors.insert(bias.name, WeightTensor { shape: bias.shape, values });
        }
        Ok(weights)
    }
    /// Derivatives with respect to every variable from the derivatives with respect to the filters of the layers.
    ///
    /// # Errors
    /// If candle fails.
    pub fn gradients(&self, of_layers: Vec<PlainFilter>) -> Result<BTreeMap<String, Vec<f32>>, TrainingError> {
        let mut gradients = BTreeMap::new();
        for (layer, of_layer) in self.spec.layers().iter().zip(of_layers) {
            let PlainFilter { weights: mut by_weights, biases: by_biases } = of_layer;
            let [mut raw, gains] = self.raw_and_gains(layer)?;
            let fan_in = raw.len() / gains.len();
            let mut by_gains = Vec::with_capacity(gains.len());
            let filters = raw.chunks_exact_mut(fan_in).zip(by_weights.chunks_exact_mut(fan_in)).zip(gains);
            for ((filter, by_filter), gain) in filters {
                // weight = gain * centered / norm, with norm^2 = sum(centered^2) + a constant.
                let norm = center(filter);
                let dot = filter.iter().zip(&*by_filter).map(|(value, by)| value * by).sum::<f32>();
                by_gains.push(dot / norm);
                for (by, value) in by_filter.iter_mut().zip(&*filter) {
                    *by = gain / norm * (*by - value * dot / (norm * norm));
                }
                subtract_mean(by_filter);
            }
            gradients.insert(format!("{}.raw", layer.name), by_weights);
            gradients.insert(format!("{}.gain", layer.name), by_gains);
            gradients.insert(format!("{}.bias", layer.name), by_biases);
        }
        Ok(gradients)
    }
}

/// Subtracts the mean of a filter, and returns the norm that standardization divides by.
fn center(filter: &mut [f32]) -> f32 {
    subtract_mean(filter);
    let squares = filter.iter().map(|value| f64::from(*value) * f64::from(*value)).sum::<f64>();
    (squares + MIN_VARIANCE * filter.len() as f64).sqrt() as f32
}

/// Subtracts the mean, unless there is only one value.
fn subtract_mean(values: &mut [f32]) {
    if values.len() > 1 {
        let mean = (values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64) as f32;
        for value in values {
            *value -= mean;
        }
    }
}
