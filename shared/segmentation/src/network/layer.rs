//! The layers of a network: named convolutions.

use kernels::images::Shape;

/// Name of the last layer of all networks on images, whose outputs are the classes.
pub const CLASS_LAYER: &str = "classes";

/// A named convolution of a network. Its tensors are `<name>.weight` and `<name>.bias` in the order of `PyTorch`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Prefix of the names of its tensors.
    pub name: String,
    /// Shape of the convolution.
    pub shape: Shape,
}

impl Layer {
    /// A square layer of stride 1.
    pub(super) fn square(
        name: String,
        side: usize,
        in_channels: Vec<usize>,
        out_channels: usize,
        rectify: bool,
    ) -> Self {
        Self { name, shape: Shape { kernel: [side; 2], stride_x: 1, in_channels, out_channels, rectify } }
    }
    /// Names and shapes of the tensors of weights and biases.
    pub fn tensors(&self) -> [(String, Vec<usize>); 2] {
        let shape = &self.shape;
        let n_in = shape.in_channels.iter().sum();
        let weight = vec![shape.out_channels, n_in, shape.kernel[0], shape.kernel[1]];
        [(format!("{}.weight", self.name), weight), (format!("{}.bias", self.name), vec![shape.out_channels])]
    }
}
