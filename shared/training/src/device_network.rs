//! A network on images whose weights are variables on a device.

use candle_core::{Device, Tensor, Var};
use kernels::images::Border;
use random::Random;
use segmentation::SegmentationError;
use segmentation::network::on_device::{DeviceFilter, Run, batch, tensors_of};
use segmentation::network::{NetworkSpec, Weights};

/// A network whose weights and biases are variables on a device, for training.
pub struct DeviceNetwork {
    spec: NetworkSpec,
    /// Weights and biases of the layers, with the names and order of `PyTorch`.
    variables: Vec<[Var; 2]>,
    filters: Vec<DeviceFilter>,
    border: Border,
    device: Device,
}

impl DeviceNetwork {
    /// Copies the weights to the device.
    ///
    /// # Errors
    /// If a tensor is missing or has another shape, or the device cannot hold it.
    pub fn new(
        spec: &NetworkSpec,
        weights: &Weights,
        border: Border,
        device: &Device,
    ) -> Result<Self, SegmentationError> {
        let mut variables = Vec::new();
        let mut filters = Vec::new();
        for filter in weights.filters(spec)? {
            let [weights, biases] = tensors_of(&filter, device)?;
            let of_layer = [Var::from_tensor(&weights)?, Var::from_tensor(&biases)?];
            filters.push(DeviceFilter::from_tensors(filter.shape.clone(), &of_layer[0], &of_layer[1])?);
            variables.push(of_layer);
        }
        Ok(Self { spec: spec.clone(), variables, filters, border, device: device.clone() })
    }
    /// The device of the variables.
    pub fn device(&self) -> &Device {
        &self.device
    }
    /// Weights and biases of the layers.
    pub fn variables(&self) -> &[[Var; 2]] {
        &self.variables
    }
    /// Runs the network on images of [`kernels::images`] of one size, with dropout if random numbers are given. The
    /// output is `[channels, images, rows, columns]`.
    ///
    /// # Errors
    /// If the images differ in size or do not fit the network.
    pub fn run(&self, images: &[&Tensor], dropout: Option<&mut Random>) -> Result<Tensor, SegmentationError> {
        let batch = batch(images, self.spec.inputs(), &self.device)?;
        let mut run = Run { filters: self.filters.iter(), border: self.border, dropout };
        self.spec.run(&mut run, batch)
    }
}
