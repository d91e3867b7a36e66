//! Losses for segmentation (thesis chapter 5 and section 6.4.2), on candle.
//!
//! All losses take logits with one row per pixel, and one-hot labels. A row of zeros is an unlabeled pixel, which is
//! ignored. Sums are taken over all pixels of the batch before any division.

mod class_sums;
mod consistency;
mod dot;
mod hierarchy;
mod log_softmax;
mod real;
mod rows;

pub use consistency::consistency;
pub use hierarchy::Hierarchy;

use candle_core::{DType, Result, Tensor};
use class_sums::ClassSums;
use dot::dot;
use log_softmax::log_softmax;
use serde::{Deserialize, Serialize};

/// Added to numerator and denominator of the set losses, pixels: an absent class that is not predicted has no cost.
const EPSILON: f64 = 1.0;

/// Added to probabilities before their logarithm.
const MIN_PROBABILITY: f64 = 1e-7;

/// A loss function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Loss {
    /// Cross-entropy, mean over pixels.
    CrossEntropy,
    /// Cross-entropy with a weight per class, weighted mean.
    WeightedCrossEntropy {
        /// Weights of the classes, above 0.
        weights: Vec<f32>,
    },
    /// Cross-entropy of each pixel times (1 - p)^gamma (Lin et al. 2017).
    Focal {
        /// Exponent, at least 0; 0 gives cross-entropy.
        gamma: f64,
    },
    /// 1 - 2 |A n B| / (|A| + |B|), mean over classes.
    Dice,
    /// 1 - |A n B| / (|A n B| + alpha FP + beta FN), mean over classes (Salehi et al. 2017).
    Tversky {
        /// Cost of a false positive. 1 with `beta` 1 is Jaccard, 0.5 with `beta` 0.5 is Dice.
        alpha: f64,
        /// Cost of a false negative.
        beta: f64,
    },
    /// 1 - |A n B| / |A u B|, mean over classes: eq. (5.1).
    Jaccard,
    /// 1 - sum(y p) / sum(y + p^power - y p), mean over classes: eq. (5.3). Its minimum is at the labels only for powers
    /// in ]1, 2].
    PowerJaccard {
        /// Power of p; 1 gives Jaccard.
        power: f64,
    },
    /// Sum of cross-entropy and Power Jaccard.
    CrossEntropyPowerJaccard {
        /// Power of the second term.
        power: f64,
    },
    /// Sum of weighted cross-entropy and Power Jaccard.
    WeightedCrossEntropyPowerJaccard {
        /// Weights of the classes in the first term, above 0.
        weights: Vec<f32>,
        /// Power of the second term.
        power: f64,
    },
}

/// One level of classes.
struct Level {
    /// Probabilities, pixels x classes.
    p: Tensor,
    /// Logarithms of the probabilities.
    log_p: Tensor,
    /// One-hot labels, pixels x classes.
    y: Tensor,
}

impl Loss {
    /// The loss of logits (pixels x classes) with one-hot labels of the same shape.
    ///
    /// # Errors
    /// If the shapes do not match.
    pub fn forward(&self, logits: &Tensor, y: &Tensor) -> Result<Tensor> {
        self.forward_level(&level(logits, y)?)
    }

    /// The sum of the loss on the classes and the loss on their nodes in the class tree: eq. (6.2), algorithm 3.
    ///
    /// # Errors
    /// If the shapes do not match.
    pub fn forward_hierarchy(&self, logits: &Tensor, y: &Tensor, hierarchy: &Hierarchy) -> Result<Tensor> {
        let leaves = level(logits, y)?;
        let nodes_of_leaves = hierarchy.matrix(logits.device())?.to_dtype(logits.dtype())?;
        let p = leaves.p.matmul(&nodes_of_leaves)?;
        let nodes = Level { log_p: (&p + MIN_PROBABILITY)?.log()?, p, y: y.matmul(&nodes_of_leaves)? };
        // Weights of classes do not apply to nodes.
        let of_nodes = match self {
            Self::WeightedCrossEntropy { .. } => Self::CrossEntropy.forward_level(&nodes)?,
            Self::WeightedCrossEntropyPowerJaccard { power, .. } => {
                Self::CrossEntropyPowerJaccard { power: *power }.forward_level(&nodes)?
            }
            other => other.forward_level(&nodes)?,
        };
        self.forward_level(&leaves)? + of_nodes
    }

    fn forward_level(&self, level: &Level) -> Result<Tensor> {
        match self {
            Self::CrossEntropy => mean_of_pixels(&level.log_p, &level.y)?.neg(),
            Self::WeightedCrossEntropy { weights } => {
                let weights = Tensor::new(weights.as_slice(), level.y.device())?.to_dtype(level.y.dtype())?;
                let weighted = level.y.broadcast_mul(&weights)?;
                mean_of_pixels(&level.log_p, &weighted)?.neg()
            }
            Self::WeightedCrossEntropyPowerJaccard { weights, power } => {
                let entropy = Self::WeightedCrossEntropy { weights: weights.clone() }.forward_level(level)?;
                entropy + level.power_jaccard(*power)?
            }
            Self::Focal { gamma } => {
                let hard = (level.p.affine(-1.0, 1.0 + MIN_PROBABILITY))?.powf(*gamma)?;
                mean_of_pixels(&(hard * &level.log_p)?, &level.y)?.neg()
            }
            Self::Dice => level.tversky(0.5, 0.5),
            Self::Tversky { alpha, beta } => level.tversky(*alpha, *beta),
            Self::Jaccard => level.tversky(1.0, 1.0),
            Self::PowerJaccard { power } => level.power_jaccard(*power),
            Self::CrossEntropyPowerJaccard { power } => {
                Self::CrossEntropy.forward_level(level)? + level.power_jaccard(*power)?
            }
        }
    }
}

fn level(logits: &Tensor, y: &Tensor) -> Result<Level> {
    let log_p = log_softmax(logits)?;
    Ok(Level { p: log_p.exp()?, log_p, y: y.clone() })
}

/// Mean of all elements with these weights.
fn mean_of_pixels(values: &Tensor, weights: &Tensor) -> Result<Tensor> {
    if !weights.device().is_cpu() {
        // Without synchronizing with the device.
        return dot(values, weights)? / weights.sum_all()?.maximum(f64::from(f32::MIN_POSITIVE))?;
    }
    let n = weights.sum_all()?.to_dtype(DType::F64)?.to_scalar::<f64>()?;
    dot(values, weights)? / n.max(f64::from(f32::MIN_POSITIVE))
}

impl Level {
    fn tversky(&self, alpha: f64, beta: f64) -> Result<Tensor> {
        let ClassSums { both, raised, labels } = ClassSums::new(&self.p, &self.y, 1.0)?;
        let false_positives = (raised - &both)?;
        let false_negatives = (labels - &both)?;
        mean_cost(&both, &((&both + (false_positives * alpha)?)? + (false_negatives * beta)?)?)
    }
    fn power_jaccard(&self, power: f64) -> Result<Tensor> {
        // y is 0 or 1, so its power is y.
        let ClassSums { both, raised, labels } = ClassSums::new(&self.p, &self.y, power)?;
        mean_cost(&both, &((labels + raised)? - &both)?)
    }
}

/// 1 - `both` / `either`, mean over classes.
fn mean_cost(both: &Tensor, either: &Tensor) -> Result<Tensor> {
    (((both + EPSILON)? / (either + EPSILON)?)?.neg()? + 1.0)?.mean_all()
}
