//! Consistency of the predictions for two views of the same points.

use super::dot::dot;
use super::log_softmax::log_softmax;
use candle_core::{Result, Tensor};

/// Mean over rows of the Kullback-Leibler divergence between the predictions for two views. `sparse` are logits for a
/// view with fewer points, `full` logits of the same points in the full view. `full` is a constant: the full view has
/// more information, so the sparse view follows it (as in Xie et al. 2020, "Unsupervised data augmentation for
/// consistency training"). Beams are dropped for generalization as in DGLSS (Kim et al. 2023), which compares the
/// features of the two views instead.
///
/// # Errors
/// If the shapes do not match.
pub fn consistency(full: &Tensor, sparse: &Tensor) -> Result<Tensor> {
    let log_p = log_softmax(&full.detach())?;
    let p = log_p.exp()?;
    let divergence = (dot(&log_p, &p)? - dot(&log_softmax(sparse)?, &p)?)?;
    divergence / full.dim(0)?.max(1) as f64
}
