//! Evaluation: loss, confusion matrix and calibration of the averaged variables.

use super::Trainer;
use crate::network::{LabeledLogits, Network};
use crate::{Dataset, TrainingError};
use candle_core::{D, Tensor};
use rayon::prelude::*;
use scores::Confusion;

/// Receives logits and classes of the labeled pixels or points of a batch.
type OfBatch<'a> = &'a mut dyn FnMut(&Tensor, &[u8]) -> Result<(), TrainingError>;

/// Rows per task: fixed, so that sums do not depend on the number of threads.
const ROWS_PER_TASK: usize = 4096;

/// Number of candidate temperatures: 0.5 to 3.9, each 10 % larger than the previous one.
const N_TEMPERATURES: usize = 22;

/// Result of an evaluation.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Mean loss of a batch.
    pub loss: f64,
    /// Confusion matrix of all examples.
    pub confusion: Confusion,
}

impl<N: Network> Trainer<N> {
    /// Evaluates all examples.
    ///
    /// # Errors
    /// If the data do not fit the network.
    pub fn evaluate(&self, data: &dyn Dataset<N::Example>) -> Result<Evaluation, TrainingError> {
        let mut confusion = Confusion::new(self.criterion.n_classes);
        let mut sum = 0.0;
        let mut n = 0;
        self.each_batch(data, &mut |logits, classes| {
            sum += f64::from(self.criterion.loss(logits, classes)?.to_scalar::<f32>()?);
            n += 1;
            for (&truth, predicted) in classes.iter().zip(logits.argmax(D::Minus1)?.to_vec1::<u32>()?) {
                confusion.add(usize::from(truth), predicted as usize);
            }
            Ok(())
        })?;
        Ok(Evaluation { loss: sum / f64::from(n.max(1)), confusion })
    }

    /// The divisor of the logits that maximizes the likelihood of the labels (temperature scaling, Guo et al. 2017). With
    /// it, a score of 0.8 is correct in four of five cases.
    ///
    /// # Errors
    /// If the data do not fit the network.
    pub fn temperature(&self, data: &dyn Dataset<N::Example>) -> Result<f32, TrainingError> {
        let temperatures: Vec<f32> = (0..N_TEMPERATURES as i32).map(|i| 0.5 * 1.1_f32.powi(i)).collect();
        let mut entropies = [0.0_f64; N_TEMPERATURES];
        self.each_batch(data, &mut |logits, classes| {
            let logits = logits.flatten_all()?.to_vec1::<f32>()?;
            let rows =
                logits.par_chunks(ROWS_PER_TASK * self.criterion.n_classes).zip(classes.par_chunks(ROWS_PER_TASK));
            let of_rows: Vec<[f64; N_TEMPERATURES]> = rows
                .map(|(rows, classes)| {
                    let mut entropies = [0.0; N_TEMPERATURES];
                    for (row, &truth) in rows.chunks_exact(self.criterion.n_classes).zip(classes) {
                        let largest = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                        for (entropy, temperature) in entropies.iter_mut().zip(&temperatures) {
                            let sum: f32 = row.iter().map(|logit| ((logit - largest) / temperature).exp()).sum();
                            *entropy += f64::from(sum.ln() - (row[usize::from(truth)] - largest) / temperature);
                        }
                    }
                    entropies
                })
                .collect();
            for of_rows in of_rows {
                entropies.iter_mut().zip(of_rows).for_each(|(entropy, of_rows)| *entropy += of_rows);
            }
            Ok(())
        })?;
        let best = (0..N_TEMPERATURES).min_by(|&a, &b| entropies[a].total_cmp(&entropies[b]));
        Ok(best.map_or(1.0, |best| temperatures[best]))
    }

    /// Runs `f` on the logits and classes of the labeled pixels or points of every batch.
    fn each_batch(&self, data: &dyn Dataset<N::Example>, f: OfBatch<'_>) -> Result<(), TrainingError> {
        let logits_of = self.averaged.evaluator(self.criterion.n_classes)?;
        let indexes: Vec<usize> = (0..data.len()).collect();
        for batch in indexes.chunks(self.settings.batch) {
            let examples: Vec<N::Example> = batch.par_iter().map(|&index| data.example(index, None)).collect();
            if let Some(LabeledLogits { logits, classes }) = logits_of(&examples)? {
                f(&logits, &classes)?;
            }
        }
        Ok(())
    }
}
