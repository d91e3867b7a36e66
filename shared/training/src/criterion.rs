//! The training criterion of a network: the loss of labeled rows of logits (pixels or points), and the selection of rows.

use crate::losses::{Hierarchy, Loss, consistency};
use crate::{TrainingError, UNKNOWN};
use candle_core::{Device, Tensor, Var};
use random::Random;

/// A loss and its derivatives with respect to the logits, on a device.
pub(crate) struct LogitDerivatives {
    /// Loss, a scalar.
    pub(crate) loss: Tensor,
    /// Derivatives, in the shape of the logits.
    pub(crate) by_logits: Tensor,
}

/// A loss and its derivatives with respect to the logits, row by row.
pub(crate) struct RowDerivatives {
    pub(crate) loss: f64,
    pub(crate) by_logits: Vec<f32>,
}

/// The loss of logits, with one row for each pixel or point.
pub struct Criterion {
    pub(crate) loss: Loss,
    pub(crate) tree: Option<Hierarchy>,
    pub(crate) n_classes: usize,
    /// Largest number of labeled rows per step; 0 for all.
    pub(crate) n_rows: usize,
    /// Weight of the consistency of two views; 0 for networks without a second view.
    pub(crate) consistency: f64,
    /// Weight of the loss on the bird's-eye view.
    pub(crate) bev_head: f64,
}

impl Criterion {
    /// A loss on at most `n_rows` labeled rows per step (0 for all), with the nodes of a class tree if one is given.
    pub fn new(loss: Loss, tree: Option<Hierarchy>, n_classes: usize, n_rows: usize) -> Self {
        Self { loss, tree, n_classes, n_rows, consistency: 0.0, bev_head: 0.0 }
    }
    /// Adds terms to the loss, by their weights: [`consistency`] of two views, and the loss of a
    /// [`BevHead`](crate::BevHead).
    #[must_use]
    pub fn with_terms(self, consistency: f64, bev_head: f64) -> Self {
        Self { consistency, bev_head, ..self }
    }
    /// Indices of the labeled rows, or of a random subset of them.
    pub(crate) fn known_rows(&self, truth: &[u8], random: &mut Random) -> Vec<u32> {
        self.some_of(known_rows(truth), random)
    }
    /// A random subset of rows, limited to the number of rows per step.
    pub(crate) fn some_of<T>(&self, mut rows: Vec<T>, random: &mut Random) -> Vec<T> {
        let wanted = self.n_rows;
        if wanted > 0 && wanted < rows.len() {
            for i in 0..wanted {
                let other = i + random.index(rows.len() - i);
                rows.swap(i, other);
            }
            rows.truncate(wanted);
        }
        rows
    }
    /// Loss of logits, one row per class of `classes`.
    pub(crate) fn loss(&self, logits: &Tensor, classes: &[u8]) -> Result<Tensor, TrainingError> {
        let mut y = vec![0.0_f32; classes.len() * self.n_classes];
        for (row, &class) in y.chunks_exact_mut(self.n_classes).zip(classes) {
            row[usize::from(class)] = 1.0;
        }
        let y = Tensor::from_vec(y, (classes.len(), self.n_classes), logits.device())?;
        Ok(match &self.tree {
            Some(tree) => self.loss.forward_hierarchy(logits, &y, tree)?,
            None => self.loss.forward(logits, &y)?,
        })
    }
    /// Loss of logits, one row per class of `classes`, plus the consistency of the remaining rows: their first half are
    /// logits of sparse views, their second half are logits of the same points in the full views.
    fn view_loss(&self, logits: &Tensor, classes: &[u8]) -> Result<Tensor, TrainingError> {
        let n_known = classes.len();
        let n_pairs = (logits.dim(0)? - n_known) / 2;
        if n_pairs == 0 {
            return self.loss(logits, classes);
        }
        let sparse = logits.narrow(0, n_known, n_pairs)?;
        let full = logits.narrow(0, n_known + n_pairs, n_pairs)?;
        let loss = self.loss(&logits.narrow(0, 0, n_known)?, classes)?;
        Ok((loss + (consistency(&full, &sparse)? * self.consistency)?)?)
    }
    /// The loss of [`Self::view_loss`] as a scalar, and its derivatives with respect to the logits.
    pub(crate) fn derive(&self, logits: &Tensor, classes: &[u8]) -> Result<LogitDerivatives, TrainingError> {
        let logits = Var::from_tensor(logits)?;
        let loss = self.view_loss(&logits, classes)?;
        let by_logits = loss.backward()?.remove(&logits).map_or_else(|| logits.zeros_like(), Ok)?;
        Ok(LogitDerivatives { loss, by_logits })
    }
    /// [`Self::derive`] for rows on the CPU.
    pub(crate) fn derive_rows(&self, logits: Vec<f32>, classes: &[u8]) -> Result<RowDerivatives, TrainingError> {
        let logits = Tensor::from_vec(logits, ((), self.n_classes), &Device::Cpu)?;
        let LogitDerivatives { loss, by_logits } = self.derive(&logits, classes)?;
        let loss = f64::from(loss.to_scalar::<f32>()?);
        Ok(RowDerivatives { loss, by_logits: by_logits.flatten_all()?.to_vec1()? })
    }
}

/// Indices of the labeled rows.
pub(crate) fn known_rows(truth: &[u8]) -> Vec<u32> {
    (0..truth.len() as u32).filter(|&i| truth[i as usize] != UNKNOWN).collect()
}
