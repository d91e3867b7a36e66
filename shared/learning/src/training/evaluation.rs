//! Loss and confusion on examples that are not learned from.

use super::{Dataset, Example, Trainer, UNKNOWN};
use crate::LearningError;
use crate::scores::Confusion;
use candle_core::D;
use rayon::prelude::*;

impl Trainer {
    /// Mean loss of a batch, and the confusion pooled over all examples.
    ///
    /// # Errors
    /// If the data does not fit the network.
    pub fn evaluate(&self, data: &dyn Dataset) -> Result<(f64, Confusion), LearningError> {
        let mut confusion = Confusion::new(self.n_classes);
        let (mut sum, mut n) = (0.0, 0);
        let indexes: Vec<usize> = (0..data.len()).collect();
        for batch in indexes.chunks(self.settings.batch) {
            let examples: Vec<Example> = batch.par_iter().map(|&index| data.example(index, None)).collect();
            let truth: Vec<u8> = examples.iter().flat_map(|example| example.truth.iter().copied()).collect();
            let known: Vec<u32> = (0..truth.len() as u32).filter(|&i| truth[i as usize] != UNKNOWN).collect();
            if known.is_empty() {
                continue;
            }
            sum += f64::from(self.loss(&examples, &truth, &known, None)?.to_scalar::<f32>()?);
            n += 1;
            let predicted = self.logits(&examples, None)?.argmax(D::Minus1)?.to_vec1::<u32>()?;
            for pixel in known {
                confusion.add(usize::from(truth[pixel as usize]), predicted[pixel as usize] as usize);
            }
        }
        Ok((sum / f64::from(n.max(1)), confusion))
    }
}
