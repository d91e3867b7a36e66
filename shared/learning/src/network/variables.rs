//! What training changes.

use super::weights::tensors_of;
use super::{Layer, NetworkSpec, Weights};
use crate::LearningError;
use crate::engine::Feature;
use crate::random::Random;
use candle_core::{Device, Tensor, Var};
use std::collections::BTreeMap;

/// Gain of standardized weights before a rectifier: sqrt(2 / (1 - 1 / pi)) keeps the variance of one layer to the next
/// (Brock et al. 2021).
const GAIN: f32 = 1.713_858;

/// Added to the variance of a filter's weights.
const LEAST_VARIANCE: f64 = 1e-8;

/// What training changes. Filters are standardized: `<layer>.weight` is what comes of `<layer>.raw` with mean 0 and
/// variance 1 / (inputs of the filter), times `<layer>.gain` of its output channel. That steadies training as batch
/// normalization does, without statistics of the batch, and leaves plain convolutions when training is over.
pub struct Variables {
    spec: NetworkSpec,
    vars: BTreeMap<String, Var>,
}

impl Variables {
    /// Random ones by seed.
    ///
    /// # Errors
    /// If candle fails.
    pub fn random(spec: &NetworkSpec, seed: u64) -> Result<Self, LearningError> {
        let mut vars = BTreeMap::new();
        for (stream, layer) in spec.layers().iter().enumerate() {
            let mut random = Random::new(seed, stream as u64);
            let [(_, weight), (bias_name, bias)] = tensors_of(layer);
            let gain = if layer.shape.rectify { GAIN } else { 1.0 };
            // As large as the filters that they stand for, so that a step of Adam turns new and trained filters alike.
            let fan_in = weight[1..].iter().product::<usize>() as f32;
            let scale = gain / fan_in.sqrt();
            let raw: Vec<f32> = (0..weight.iter().product()).map(|_| scale * random.gauss()).collect();
            let mut insert = |name: String, values: Vec<f32>, shape: &[usize]| -> Result<(), LearningError> {
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
    /// Those whose standardized filters are these weights: what fine-tuning starts from.
    ///
    /// # Errors
    /// If a tensor is absent or of another shape, or a filter's mean is not zero as that of all filters trained here is.
    pub fn from_weights(spec: &NetworkSpec, weights: &Weights) -> Result<Self, LearningError> {
        weights.filters(spec)?;
        let variables = Self::random(spec, 0)?;
        variables.begin_with(weights)?;
        Ok(variables)
    }
    /// Takes over the layers whose names and shapes are those of weights, which may be another network's, and returns how
    /// many there are.
    ///
    /// # Errors
    /// If a filter's mean is not zero as that of all filters trained here is.
    pub fn begin_with(&self, weights: &Weights) -> Result<usize, LearningError> {
        let mut n_taken = 0;
        for layer in self.spec.layers() {
            let [(weight_name, shape), (bias_name, bias_shape)] = tensors_of(&layer);
            let Some((_, values)) = weights.tensors.get(&weight_name).filter(|(of, _)| *of == shape) else { continue };
            let fan_in = values.len() / bias_shape[0];
            let gains = values.chunks_exact(fan_in).map(|filter| {
                let mean = filter.iter().sum::<f32>() / fan_in as f32;
                let variance = filter.iter().map(|w| (w - mean).powi(2)).sum::<f32>() / fan_in as f32;
                (variance * fan_in as f32).sqrt()
            });
            let gains: Vec<f32> = gains.collect();
            let mean = |filter: &[f32]| filter.iter().sum::<f32>() / fan_in as f32;
            let off = |(filter, gain): (&[f32], &f32)| mean(filter).abs() * fan_in as f32 > 1e-2 * gain + 1e-6;
            if fan_in > 1 && values.chunks_exact(fan_in).zip(&gains).any(off) {
                let reason =
                    format!("`{weight_name}` has filters whose mean is not zero: they can be run, not trained further");
                return Err(candle_core::Error::Msg(reason).into());
            }
            self.set(&format!("{}.raw", layer.name), values.clone(), &shape)?;
            self.set(&format!("{}.gain", layer.name), gains, &bias_shape)?;
            self.set(&bias_name, weights.tensors[&bias_name].1.clone(), &bias_shape)?;
            n_taken += 1;
        }
        Ok(n_taken)
    }
    /// Replaces the numbers of one.
    ///
    /// # Errors
    /// If it does not exist or has another shape.
    pub fn set(&self, name: &str, values: Vec<f32>, shape: &[usize]) -> Result<(), LearningError> {
        let var = self.vars.get(name);
        let var = var.ok_or_else(|| candle_core::Error::Msg(format!("no variable `{name}`")))?;
        Ok(var.set(&Tensor::from_vec(values, shape, &Device::Cpu)?)?)
    }
    /// The same numbers in memory of their own.
    ///
    /// # Errors
    /// If candle fails.
    pub fn copied(&self) -> Result<Self, LearningError> {
        let copied = |(name, var): (&String, &Var)| Ok((name.clone(), Var::from_tensor(&var.copy()?)?));
        let vars = self.vars.iter().map(copied).collect::<Result<_, LearningError>>()?;
        Ok(Self { spec: self.spec.clone(), vars })
    }
    /// Moves every number by this share of the way to those of `other`, of the same network.
    ///
    /// # Errors
    /// If candle fails.
    pub fn move_to(&self, other: &Self, share: f64) -> Result<(), LearningError> {
        for (var, to) in self.vars.values().zip(other.vars.values()) {
            var.set(&(var.affine(1.0 - share, 0.0)? + to.affine(share, 0.0)?)?)?;
        }
        Ok(())
    }
    /// By name, in the order of the names.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.vars.iter().map(|(name, var)| (name.as_str(), var))
    }
    /// The network's form.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// Filter of a layer.
    fn weight(&self, layer: &Layer) -> Result<Tensor, LearningError> {
        let [raw, gain] = ["raw", "gain"].map(|kind| &self.vars[&format!("{}.{kind}", layer.name)]);
        let n_out = layer.shape.out_channels;
        let rows = raw.reshape((n_out, ()))?;
        let fan_in = rows.dim(1)? as f64;
        let centered = if fan_in > 1.0 { rows.broadcast_sub(&rows.mean_keepdim(1)?)? } else { rows };
        let variance = centered.sqr()?.mean_keepdim(1)?;
        let scale = ((variance + LEAST_VARIANCE)? * fan_in)?.sqrt()?.recip()?;
        let scale = scale.mul(&gain.reshape((n_out, 1))?)?;
        Ok(centered.broadcast_mul(&scale)?.reshape(raw.shape())?)
    }
    /// The filters as they are now.
    ///
    /// # Errors
    /// If candle fails.
    pub fn weights(&self) -> Result<Weights, LearningError> {
        let mut weights = Weights::default();
        for layer in self.spec.layers() {
            let [(weight_name, shape), (bias_name, bias_shape)] = tensors_of(&layer);
            let values = self.weight(&layer)?.flatten_all()?.to_vec1::<f32>()?;
            weights.tensors.insert(weight_name, (shape, values));
            let bias = self.vars[&bias_name].to_vec1::<f32>()?;
            weights.tensors.insert(bias_name, (bias_shape, bias));
        }
        Ok(weights)
    }
    /// Derivatives by every variable from those by the packed filters, by layer.
    ///
    /// # Errors
    /// If candle fails.
    pub fn gradients(&self, by_filters: &[Vec<Feature>]) -> Result<BTreeMap<String, Vec<f32>>, LearningError> {
        let mut gradients = BTreeMap::new();
        // What changes with a filter as the loss does: candle derives the standardization from it.
        let mut sum = Tensor::new(0.0_f32, &Device::Cpu)?;
        for (layer, packed) in self.spec.layers().iter().zip(by_filters) {
            let [(_, shape), (bias_name, _)] = tensors_of(layer);
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
