//! The optimizer Adam (Kingma and Ba 2015).

use crate::TrainingError;
use candle_core::{Device, Tensor, Var};
use std::collections::BTreeMap;

/// Decay of the mean of the derivatives.
const BETA_1: f64 = 0.9;
/// Decay of the mean of the squared derivatives.
const BETA_2: f64 = 0.999;
/// Added to the root of the mean square.
const EPSILON: f64 = 1e-8;
/// Largest norm of the derivatives of all variables; larger ones are scaled down. A single outlier batch then cannot undo
/// an epoch.
const MAX_NORM: f64 = 5.0;

/// State of the optimizer.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Learning rate.
    pub rate: f64,
    pub(crate) steps: u64,
    /// Means of the derivatives and of their squares, by variable.
    pub(crate) means: BTreeMap<String, [Vec<f32>; 2]>,
}

impl Adam {
    /// An optimizer before its first step.
    pub fn new(rate: f64) -> Self {
        Self { rate, steps: 0, means: BTreeMap::new() }
    }
    /// Number of steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }
    /// Updates all variables except those with a `frozen` prefix.
    ///
    /// # Errors
    /// If candle fails.
    pub fn step(
        &mut self,
        variables: &BTreeMap<String, Var>,
        mut gradients: BTreeMap<String, Vec<f32>>,
        frozen: &[String],
    ) -> Result<(), TrainingError> {
        gradients.retain(|name, _| !frozen.iter().any(|prefix| name.starts_with(prefix)));
        let square = |values: &Vec<f32>| values.iter().map(|v| f64::from(*v) * f64::from(*v)).sum::<f64>();
        let norm = gradients.values().map(square).sum::<f64>().sqrt();
        let scale = if norm > MAX_NORM { (MAX_NORM / norm) as f32 } else { 1.0 };
        self.steps += 1;
        let n = self.steps.min(1 << 30) as i32;
        let [correct_1, correct_2] = [BETA_1, BETA_2].map(|beta| 1.0 - beta.powi(n));
        let rate = (self.rate * correct_2.sqrt() / correct_1) as f32;
        let epsilon = (EPSILON * correct_2.sqrt()) as f32;
        let [beta_1, beta_2] = [BETA_1 as f32, BETA_2 as f32];
        for (name, var) in variables {
            let Some(gradient) = gradients.get(name) else { continue };
            let mut values = var.flatten_all()?.to_vec1::<f32>()?;
            let zeros = || [vec![0.0; gradient.len()], vec![0.0; gradient.len()]];
            let [mean, square] = self.means.entry(name.clone()).or_insert_with(zeros);
            let state = mean.iter_mut().zip(square).zip(&mut values).zip(gradient);
            for (((mean, square), value), gradient) in state {
                let gradient = gradient * scale;
                *mean = beta_1 * *mean + (1.0 - beta_1) * gradient;
                *square = beta_2 * *square + (1.0 - beta_2) * gradient * gradient;
                *value -= rate * *mean / (square.sqrt() + epsilon);
            }
            var.set(&Tensor::from_vec(values, var.shape(), &Device::Cpu)?)?;
        }
        Ok(())
    }
}
