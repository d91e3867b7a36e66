//! Losses for segmentation (thesis chapter 5 and section 6.4.2), on candle.
//!
//! All take logits with one row per pixel and truth as rows of zeros with a one at the class. A row of zeros throughout is a
//! pixel that counts nowhere. Sums run over all pixels of the batch before anything is divided.

mod hierarchy;

pub use hierarchy::Hierarchy;

use candle_core::{D, DType, Result, Tensor};
use serde::{Deserialize, Serialize};

/// Added to numerator and denominator of the set losses, pixels: a class that is neither there nor predicted costs nothing.
const EPSILON: f64 = 1.0;

/// Least probability whose logarithm is taken where only probabilities are at hand.
const LEAST: f64 = 1e-7;

/// What training makes small.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Loss {
    /// Cross-entropy, mean over pixels.
    CrossEntropy,
    /// Cross-entropy with a weight for each class, mean by weight.
    WeightedCrossEntropy {
        /// By class, each above 0.
        weights: Vec<f32>,
    },
    /// Cross-entropy of each pixel times (1 - p)^gamma (Lin et al. 2017).
    Focal {
        /// 0 or more; 0 is cross-entropy.
        gamma: f64,
    },
    /// 1 - 2 |A n B| / (|A| + |B|), mean over classes.
    Dice,
    /// 1 - |A n B| / (|A n B| + alpha FP + beta FN), mean over classes (Salehi et al. 2017).
    Tversky {
        /// Cost of a false alarm; 1 with `beta` 1 is Jaccard, 0.5 with 0.5 Dice.
        alpha: f64,
        /// Cost of a miss.
        beta: f64,
    },
    /// 1 - |A n B| / |A u B|, mean over classes: eq. (5.1).
    Jaccard,
    /// 1 - sum(y p) / sum(y + p^power - y p), mean over classes: eq. (5.3). It has its minimum at the truth for powers in
    /// ]1, 2] only.
    PowerJaccard {
        /// 1 is Jaccard.
        power: f64,
    },
    /// Cross-entropy and Power Jaccard.
    CrossEntropyPowerJaccard {
        /// Of the second.
        power: f64,
    },
    /// Weighted cross-entropy and Power Jaccard.
    WeightedCrossEntropyPowerJaccard {
        /// Of the first; by class, each above 0.
        weights: Vec<f32>,
        /// Of the second.
        power: f64,
    },
}

/// One level of classes.
struct Level {
    /// Probabilities, pixels x classes.
    p: Tensor,
    /// Their logarithms.
    log_p: Tensor,
    /// Truth, pixels x classes.
    y: Tensor,
}

impl Loss {
    /// Of logits (pixels x classes) against truth of the same shape.
    ///
    /// # Errors
    /// If the shapes do not agree.
    pub fn of_logits(&self, logits: &Tensor, y: &Tensor) -> Result<Tensor> {
        self.of_level(&level(logits, y)?)
    }

    /// The sum of this loss on the classes and on the nodes of the tree above them: eq. (6.2), algorithm 3.
    ///
    /// # Errors
    /// If the shapes do not agree.
    pub fn of_hierarchy(&self, logits: &Tensor, y: &Tensor, hierarchy: &Hierarchy) -> Result<Tensor> {
        let leaves = level(logits, y)?;
        let nodes_of_leaves = hierarchy.matrix(logits.device())?.to_dtype(logits.dtype())?;
        let p = leaves.p.matmul(&nodes_of_leaves)?;
        let nodes = Level { log_p: (&p + LEAST)?.log()?, p, y: y.matmul(&nodes_of_leaves)? };
        // Weights by class mean nothing to nodes.
        let of_nodes = match self {
            Self::WeightedCrossEntropy { .. } => Self::CrossEntropy.of_level(&nodes)?,
            Self::WeightedCrossEntropyPowerJaccard { power, .. } => {
                Self::CrossEntropyPowerJaccard { power: *power }.of_level(&nodes)?
            }
            other => other.of_level(&nodes)?,
        };
        self.of_level(&leaves)? + of_nodes
    }

    fn of_level(&self, level: &Level) -> Result<Tensor> {
        match self {
            Self::CrossEntropy => mean_of_pixels(&(&level.y * &level.log_p)?.neg()?, &level.y),
            Self::WeightedCrossEntropy { weights } => {
                let weights = Tensor::new(weights.as_slice(), level.y.device())?.to_dtype(level.y.dtype())?;
                let weighted = level.y.broadcast_mul(&weights)?;
                mean_of_pixels(&(&weighted * &level.log_p)?.neg()?, &weighted)
            }
            Self::WeightedCrossEntropyPowerJaccard { weights, power } => {
                let entropy = Self::WeightedCrossEntropy { weights: weights.clone() }.of_level(level)?;
                entropy + level.power_jaccard(*power)?
            }
            Self::Focal { gamma } => {
                let hard = (level.p.affine(-1.0, 1.0 + LEAST))?.powf(*gamma)?;
                mean_of_pixels(&((&level.y * hard)? * &level.log_p)?.neg()?, &level.y)
            }
            Self::Dice => level.tversky(0.5, 0.5),
            Self::Tversky { alpha, beta } => level.tversky(*alpha, *beta),
            Self::Jaccard => level.tversky(1.0, 1.0),
            Self::PowerJaccard { power } => level.power_jaccard(*power),
            Self::CrossEntropyPowerJaccard { power } => {
                Self::CrossEntropy.of_level(level)? + level.power_jaccard(*power)?
            }
        }
    }
}

fn level(logits: &Tensor, y: &Tensor) -> Result<Level> {
    // The largest logit is taken away so that no exponential overflows; it has no part in the derivative.
    let largest = logits.detach().max_keepdim(D::Minus1)?;
    let shifted = logits.broadcast_sub(&largest)?;
    let log_sum = shifted.exp()?.sum_keepdim(D::Minus1)?.log()?;
    let log_p = shifted.broadcast_sub(&log_sum)?;
    Ok(Level { p: log_p.exp()?, log_p, y: y.clone() })
}

/// Sum of all elements over the sum of `y`.
fn mean_of_pixels(values: &Tensor, y: &Tensor) -> Result<Tensor> {
    let n = y.sum_all()?.to_dtype(DType::F64)?.to_scalar::<f64>()?;
    values.sum_all()? / n.max(f64::from(f32::MIN_POSITIVE))
}

impl Level {
    /// Probabilities where the truth is known, zero elsewhere.
    fn known(&self) -> Result<Tensor> {
        self.p.broadcast_mul(&self.y.sum_keepdim(D::Minus1)?)
    }
    fn tversky(&self, alpha: f64, beta: f64) -> Result<Tensor> {
        let (p, y) = (self.known()?, &self.y);
        let both = (&p * y)?.sum(0)?;
        let false_alarms = (p.sum(0)? - &both)?;
        let misses = (y.sum(0)? - &both)?;
        let either = ((&both + (false_alarms * alpha)?)? + (misses * beta)?)?;
        (((both + EPSILON)? / (either + EPSILON)?)?.neg()? + 1.0)?.mean_all()
    }
    fn power_jaccard(&self, power: f64) -> Result<Tensor> {
        let (p, y) = (self.known()?, &self.y);
        let both = (&p * y)?.sum(0)?;
        // y is 0 or 1: its power is itself.
        // A square is the usual power, and many times faster than a power.
        let raised = if power == 2.0 { p.sqr()? } else { p.powf(power)? };
        let either = ((y.sum(0)? + raised.sum(0)?)? - &both)?;
        (((both + EPSILON)? / (either + EPSILON)?)?.neg()? + 1.0)?.mean_all()
    }
}
