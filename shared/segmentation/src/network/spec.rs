//! Architectures of networks on images.

use super::executor::Executor;
use super::layer::Layer;
use super::published::spherical_dz;
use super::unet;
use crate::SegmentationError;
use serde::{Deserialize, Serialize};

/// Architecture of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum NetworkSpec {
    /// U-Net with two 3 x 3 convolutions per level (Ronneberger et al. 2015).
    Unet {
        /// Channels of the input.
        inputs: usize,
        /// Channels of the output.
        outputs: usize,
        /// Channels of each level, finest first, 1 to 6 levels.
        widths: Vec<usize>,
        /// Channels of the last 3 x 3 convolution; by default the channels of the finest level. Folded columns share
        /// them.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        head: Option<usize>,
    },
    /// Spherical `DZNet` (thesis figure 6.10): 5 x 5 convolutions that halve the columns, 1 x 1 convolutions with dropout,
    /// upsampling with skip connections, and the input concatenated with the last features.
    SphericalDz {
        /// Channels of the input.
        inputs: usize,
        /// Channels of the output.
        outputs: usize,
        /// Channels of each level, 1 to 6 levels.
        widths: Vec<usize>,
    },
}

impl NetworkSpec {
    /// Channels of the input.
    pub fn inputs(&self) -> usize {
        match self {
            Self::Unet { inputs, .. } | Self::SphericalDz { inputs, .. } => *inputs,
        }
    }
    /// Channels of the output.
    pub fn outputs(&self) -> usize {
        match self {
            Self::Unet { outputs, .. } | Self::SphericalDz { outputs, .. } => *outputs,
        }
    }
    /// Channels of each level, finest first.
    pub fn widths(&self) -> &[usize] {
        match self {
            Self::Unet { widths, .. } | Self::SphericalDz { widths, .. } => widths,
        }
    }
    /// Divisors of the rows and columns of an image.
    pub fn multiple_of(&self) -> [usize; 2] {
        let levels = self.widths().len();
        match self {
            Self::Unet { .. } => [1 << (levels - 1); 2],
            Self::SphericalDz { .. } => [1, 1 << levels],
        }
    }
    /// The first violated rule, if any.
    pub fn problem(&self) -> Option<String> {
        let inputs = self.inputs();
        let outputs = self.outputs();
        let widths = self.widths();
        // A network with more channels would be too slow alongside the other stages.
        let in_range = |n: usize| (1..=1024).contains(&n);
        let head = if let Self::Unet { head: Some(head), .. } = self { *head } else { 1 };
        if ![inputs, outputs, head].iter().chain(widths).all(|&width| in_range(width)) {
            return Some("channels must be 1 to 1024".to_owned());
        }
        (!(1..=6).contains(&widths.len())).then(|| format!("{} levels, must be 1 to 6", widths.len()))
    }
    /// All convolutions in the order of application.
    pub fn layers(&self) -> Vec<Layer> {
        match self {
            Self::Unet { inputs, outputs, widths, head } => unet::layers(*inputs, *outputs, widths, *head),
            Self::SphericalDz { inputs, outputs, widths } => spherical_dz::layers(*inputs, *outputs, widths),
        }
    }
    /// Runs the network.
    ///
    /// # Errors
    /// If the executor fails.
    pub fn run<E: Executor>(&self, executor: &mut E, input: E::Image) -> Result<E::Image, SegmentationError> {
        let layers = self.layers();
        match self {
            Self::Unet { widths, .. } => unet::run(executor, &layers, widths.len(), input),
            Self::SphericalDz { widths, .. } => spherical_dz::run(executor, &layers, widths.len(), &input),
        }
    }
}
