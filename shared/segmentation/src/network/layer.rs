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

/// Name and shape of a tensor of a layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorShape {
    /// Name in `PyTorch`.
    pub name: String,
    /// Shape in `PyTorch`.
    pub shape: Vec<usize>,
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
    /// The tensors of weights `[out, in, rows, columns]` and biases `[out]`.
    pub fn tensors(&self) -> [TensorShape; 2] {
        let shape = &self.shape;
        let n_in = shape.in_channels.iter().sum();
        let of_weights = vec![shape.out_channels, n_in, shape.kernel[0], shape.kernel[1]];
        [
            TensorShape { name: format!("{}.weight", self.name), shape: of_weights },
            TensorShape { name: format!("{}.bias", self.name), shape: vec![shape.out_channels] },
        ]
    }
}
