//! Networks: written once, run to infer ([`Inference`]) and to learn ([`Differential`]), by the same kernels.

mod differential;
mod inference;
mod spherical_dz;
mod unet;
mod variables;
mod weights;

pub use differential::{Differential, Recording};
pub use inference::{Inference, Lent, Spare};
pub use variables::Variables;
pub use weights::Weights;

use crate::LearningError;
use crate::engine::Shape;
use serde::{Deserialize, Serialize};

/// Form of a network. All images are circular in the columns or not, as `border` says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum NetworkSpec {
    /// U-Net of two 3 x 3 convolutions per level (Ronneberger et al. 2015).
    Unet {
        /// Channels of the input.
        inputs: usize,
        /// Channels of the result.
        outputs: usize,
        /// Channels of each level, the finest first, 1 to 6 levels.
        widths: Vec<usize>,
        /// Channels of the last 3 x 3 convolution, from which the classes are told; those of the finest level where there is
        /// none. Columns that are folded share them.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        head: Option<usize>,
    },
    /// Spherical `DZNet` (thesis figure 6.10): 5 x 5 convolutions that halve the columns, 1 x 1 convolutions with dropout,
    /// upsampling with the finer level beside it, and the input itself beside the last features.
    SphericalDz {
        /// Channels of the input.
        inputs: usize,
        /// Channels of the result.
        outputs: usize,
        /// Channels of each level, 1 to 6 levels.
        widths: Vec<usize>,
    },
}

/// A convolution of a network by its name: tensors `<name>.weight` and `<name>.bias`, in `PyTorch`'s order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Of its tensors.
    pub name: String,
    /// Its form.
    pub shape: Shape,
}

/// What runs a network.
pub trait Executor {
    /// Its images.
    type Image;
    /// Applies a layer.
    fn convolution(&mut self, layer: &Layer, sources: &[&Self::Image]) -> Result<Self::Image, LearningError>;
    /// The largest of every rows x columns.
    fn max_pool(&mut self, image: &Self::Image, factor: [usize; 2]) -> Result<Self::Image, LearningError>;
    /// Every pixel rows x columns times.
    fn upsample(&mut self, image: &Self::Image, factor: [usize; 2]) -> Result<Self::Image, LearningError>;
    /// Zero for a share of the values while it trains, and the others larger to make up for it.
    fn dropout(&mut self, image: Self::Image, rate: f32) -> Result<Self::Image, LearningError>;
}

impl NetworkSpec {
    /// Channels of input and result, and of the levels.
    pub fn channels(&self) -> (usize, usize, &[usize]) {
        match self {
            Self::Unet { inputs, outputs, widths, .. } | Self::SphericalDz { inputs, outputs, widths } => {
                (*inputs, *outputs, widths)
            }
        }
    }
    /// Rows and columns of an image must be multiples of these.
    pub fn multiple_of(&self) -> [usize; 2] {
        let levels = self.channels().2.len();
        match self {
            Self::Unet { .. } => [1 << (levels - 1); 2],
            Self::SphericalDz { .. } => [1, 1 << levels],
        }
    }
    /// What is wrong with the numbers, if anything.
    pub fn problem(&self) -> Option<String> {
        let (inputs, outputs, widths) = self.channels();
        // More would not run beside the other stages.
        let in_range = |n: usize| (1..=1024).contains(&n);
        let head = if let Self::Unet { head: Some(head), .. } = self { *head } else { 1 };
        if ![inputs, outputs, head].iter().chain(widths).all(|&width| in_range(width)) {
            return Some("channels must be 1 to 1024".to_owned());
        }
        (!(1..=6).contains(&widths.len())).then(|| format!("{} levels, must be 1 to 6", widths.len()))
    }
    /// All convolutions in the order in which they are applied.
    pub fn layers(&self) -> Vec<Layer> {
        match self {
            Self::Unet { inputs, outputs, widths, head } => unet::layers(*inputs, *outputs, widths, *head),
            Self::SphericalDz { inputs, outputs, widths } => spherical_dz::layers(*inputs, *outputs, widths),
        }
    }
    /// Applies the network.
    ///
    /// # Errors
    /// If the executor fails.
    pub fn run<E: Executor>(&self, executor: &mut E, input: E::Image) -> Result<E::Image, LearningError> {
        let layers = self.layers();
        match self {
            Self::Unet { widths, .. } => unet::run(executor, &layers, widths.len(), input),
            Self::SphericalDz { widths, .. } => spherical_dz::run(executor, &layers, widths.len(), &input),
        }
    }
    /// Weights and biases.
    pub fn n_parameters(&self) -> usize {
        let of_layer = |layer: &Layer| {
            let n_in: usize = layer.shape.in_channels.iter().sum();
            layer.shape.out_channels * (n_in * layer.shape.kernel[0] * layer.shape.kernel[1] + 1)
        };
        self.layers().iter().map(of_layer).sum()
    }
}

/// A layer of stride 1.
fn layer(name: String, side: usize, in_channels: Vec<usize>, out_channels: usize, rectify: bool) -> Layer {
    Layer { name, shape: Shape { kernel: [side; 2], stride_x: 1, in_channels, out_channels, rectify } }
}
