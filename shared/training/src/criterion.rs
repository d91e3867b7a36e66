//! What a network is trained with: the loss of labeled rows of logits, pixels or points, and which of them are used.

use crate::losses::{Hierarchy, Loss};
use crate::{TrainingError, UNKNOWN};
use candle_core::{Device, Tensor, Var};
use random::Random;

/// The loss of logits, one row for each pixel or point.
pub struct Criterion {
    pub(crate) loss: Loss,
    pub(crate) tree: Option<Hierarchy>,
    pub(crate) n_classes: usize,
    /// Labeled rows that a step uses at most; 0 for all.
    pub(crate) n_rows: usize,
}

impl Criterion {
    /// A loss, with the nodes of a class tree if there is one, of `n_rows` labeled rows of a step; 0 for all.
    pub fn new(loss: Loss, tree: Option<Hierarchy>, n_classes: usize, n_rows: usize) -> Self {
        Self { loss, tree, n_classes, n_rows }
    }
    /// Indices of the labeled rows, or of some of them, drawn at random.
    pub(crate) fn known_rows(&self, truth: &[u8], random: &mut Random) -> Vec<u32> {
        let mut known = known_rows(truth);
        let wanted = self.n_rows;
        if wanted > 0 && wanted < known.len() {
            for i in 0..wanted {
                let other = i + random.index(known.len() - i);
                known.swap(i, other);
            }
            known.truncate(wanted);
        }
        known
    }
    /// Loss of logits, one row per class of `classes`.
    pub(crate) fn of_logits(&self, logits: &Tensor, classes: &[u8]) -> Result<Tensor, TrainingError> {
        let mut y = vec![0.0_f32; classes.len() * self.n_classes];
        for (row, &class) in y.chunks_exact_mut(self.n_classes).zip(classes) {
            row[usize::from(class)] = 1.0;
        }
        let y = Tensor::from_vec(y, (classes.len(), self.n_classes), logits.device())?;
        Ok(match &self.tree {
            Some(tree) => self.loss.of_hierarchy(logits, &y, tree)?,
            None => self.loss.of_logits(logits, &y)?,
        })
    }
    /// The loss, one number, and its derivatives with respect to the logits.
    pub(crate) fn derive(&self, logits: &Tensor, classes: &[u8]) -> Result<(Tensor, Tensor), TrainingError> {
        let logits = Var::from_tensor(logits)?;
        let loss = self.of_logits(&logits, classes)?;
        let by_logits = loss.backward()?.remove(&logits).map_or_else(|| logits.zeros_like(), Ok)?;
        Ok((loss, by_logits))
    }
    /// [`Self::derive`] of rows on the CPU.
    pub(crate) fn derive_rows(&self, logits: Vec<f32>, classes: &[u8]) -> Result<(f64, Vec<f32>), TrainingError> {
        let logits = Tensor::from_vec(logits, (classes.len(), self.n_classes), &Device::Cpu)?;
        let (loss, by_logits) = self.derive(&logits, classes)?;
        Ok((f64::from(loss.to_scalar::<f32>()?), by_logits.flatten_all()?.to_vec1()?))
    }
}

/// Indices of the labeled rows.
pub(crate) fn known_rows(truth: &[u8]) -> Vec<u32> {
    (0..truth.len() as u32).filter(|&i| truth[i as usize] != UNKNOWN).collect()
}
