//! The variables of a training.

use crate::TrainingError;
use candle_core::{Device, Tensor, Var};
use random::Random;
use segmentation::engine::Feature;
use segmentation::network::{Layer, NetworkSpec, Weights};
use std::collections::BTreeMap;

/// Gain of standardized weights before a rectifier: sqrt(2 / (1 - 1 / pi)) keeps the variance from layer to layer (Brock et al. 2021).
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
    /// Random variables of a seed.
    ///
    /// # Errors
    /// If candle fails.
    pub fn random(spec: &NetworkSpec, seed: u64) -> Result<Self, TrainingError> {
        let mut vars = BTreeMap::new();
        for (stream, layer) in spec.layers().iter().enumerate() {
            let mut random = Random::of_stream(seed, stream as u64);
            let [(_, weight), (bias_name, bias)] = layer.tensors();
            let gain = if layer.shape.rectify { GAIN } else { 1.0 };
            // With the norm of standardized filters, so that a step of Adam rotates new and trained filters alike.
            let fan_in = weight[1..].iter().product::<usize>() as f32;
            let scale = gain / fan_in.sqrt();
            let raw: Vec<f32> = (0..weight.iter().product()).map(|_| scale * random.gauss()).collect();
            let mut insert = |name: String, values: Vec<f32>, shape: &[usize]| -> Result<(), TrainingError> {
                let tensor = Tensor::from_vec(values, shape, &Device::Cpu)?;
                vars.insert(name, Var::from_tensor(&tensor)?);
                Ok(())
            };
            insert(format!("{}.raw", layer.name), raw, &weight)?;
            insert(format!("{}.gain", layer.name), vec![gain; bias[0]], &bias)?;
            insert(bias_name, vec![0.0; bias[0]], &bias)?;
        }
        Ok(Self { spec: spec.clone(), vars })
    }
    /// Variables whose standardized filters are these weights, for fine-tuning.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape, or the mean of a filter is not zero, as it is in all filters trained here.
    pub fn from_weights(spec: &NetworkSpec, weights: &Weights) -> Result<Self, TrainingError> {
        weights.filters(spec)?;
        let variables = Self::random(spec, 0)?;
        variables.begin_with(weights)?;
        Ok(variables)
    }
    /// Initializes the layers whose names and shapes occur in the weights, which may be those of another network. Returns the number
    /// of these layers.
    ///
    /// # Errors
    /// If the mean of a filter is not zero, as it is in all filters trained here.
    pub fn begin_with(&self, weights: &Weights) -> Result<usize, TrainingError> {
        let mut n_taken = 0;
        for layer in self.spec.layers() {
            let [(weight_name, shape), (bias_name, bias_shape)] = layer.tensors();
            let Some((_, values)) = weights.tensors.get(&weight_name).filter(|(of, _)| *of == shape) else { continue };
            let fan_in = values.len() / bias_shape[0];
            let gains = values.chunks_exact(fan_in).map(|filter| {
                let mean = filter.iter().sum::<f32>() / fan_in as f32;
                let variance = filter.iter().map(|w| (w - mean).powi(2)).sum::<f32>() / fan_in as f32;
                (variance * fan_in as f32).sqrt()
            });
            let gains: Vec<f32> = gains.collect();
            let mean = |filter: &[f32]| filter.iter().sum::<f32>() / fan_in as f32;
            let is_shifted = |(filter, gain): (&[f32], &f32)| mean(filter).abs() * fan_in as f32 > 1e-2 * gain + 1e-6;
            if fan_in > 1 && values.chunks_exact(fan_in).zip(&gains).any(is_shifted) {
                return Err(TrainingError::NotStandardized { name: weight_name });
            }
            self.set(&format!("{}.raw", layer.name), values.clone(), &shape)?;
            self.set(&format!("{}.gain", layer.name), gains, &bias_shape)?;
            self.set(&bias_name, weights.tensors[&bias_name].1.clone(), &bias_shape)?;
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
    /// The standardized filter of a layer.
    fn weight(&self, layer: &Layer) -> Result<Tensor, TrainingError> {
        let [raw, gain] = ["raw", "gain"].map(|kind| &self.vars[&format!("{}.{kind}", layer.name)]);
        let n_out = layer.shape.out_channels;
        let rows = raw.reshape((n_out, ()))?;
        let fan_in = rows.dim(1)? as f64;
        let centered = if fan_in > 1.0 { rows.broadcast_sub(&rows.mean_keepdim(1)?)? } else { rows };
        let variance = centered.sqr()?.mean_keepdim(1)?;
        let scale = ((variance + MIN_VARIANCE)? * fan_in)?.sqrt()?.recip()?;
        let scale = scale.mul(&gain.reshape((n_out, 1))?)?;
        Ok(centered.broadcast_mul(&scale)?.reshape(raw.shape())?)
    }
    /// The current standardized filters and biases.
    ///
    /// # Errors
    /// If candle fails.
    pub fn weights(&self) -> Result<Weights, TrainingError> {
        let mut weights = Weights::default();
        for layer in self.spec.layers() {
            let [(weight_name, shape), (bias_name, bias_shape)] = layer.tensors();
            let values = self.weight(&layer)?.flatten_all()?.to_vec1::<f32>()?;
            weights.tensors.insert(weight_name, (shape, values));
            let bias = self.vars[&bias_name].to_vec1::<f32>()?;
            weights.tensors.insert(bias_name, (bias_shape, bias));
        }
        Ok(weights)
    }
    /// Derivatives with respect to every variable from those with respect to the packed filters of the layers.
    ///
    /// # Errors
    /// If candle fails.
    pub fn gradients(&self, by_filters: &[Vec<Feature>]) -> Result<BTreeMap<String, Vec<f32>>, TrainingError> {
        let mut gradients = BTreeMap::new();
        // A sum with the derivatives of the loss: candle differentiates the standardization with it.
        let mut sum = Tensor::new(0.0_f32, &Device::Cpu)?;
        for (layer, packed) in self.spec.layers().iter().zip(by_filters) {
            let [(_, shape), (bias_name, _)] = layer.tensors();
            let (by_weights, by_biases) = layer.shape.unpacked(packed);
            sum = (sum + (self.weight(layer)? * Tensor::from_vec(by_weights, shape, &Device::Cpu)?)?.sum_all()?)?;
            gradients.insert(bias_name, by_biases);
        }
        let derived = sum.backward()?;
        for (name, var) in &self.vars {
            if let Some(gradient) = derived.get(var) {
                gradients.insert(name.clone(), gradient.flatten_all()?.to_vec1::<f32>()?);
            }
        }
        Ok(gradients)
    }
}
