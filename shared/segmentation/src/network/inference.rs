//! Inference: a network as a graph of operations of candle.

use super::blocked::{self, ImagePool, PooledImage};
use super::executor::Executor;
use super::layer::Layer;
use super::on_device::{self, DeviceFilter, batch};
use super::spec::NetworkSpec;
use super::weights::Weights;
use crate::SegmentationError;
use candle_core::{Device, Tensor};
use kernels::images::tensors::{ToBlocks, size_of_image};
use kernels::images::{Border, Filter, PlanesMut, Shape, blocks};
use rayon::prelude::*;

/// A network ready to run. Several threads may run it at the same time.
///
/// Inputs and outputs are images of [`kernels::images`] in tensors on the CPU, wherever the network runs.
#[derive(Debug)]
pub struct Inference {
    spec: NetworkSpec,
    filters: Vec<Filter>,
    /// The filters for the operations of candle, and their device; without them, the kernels of [`kernels::images`]
    /// run.
    on_device: Option<(Device, Vec<DeviceFilter>)>,
    border: Border,
    pool: ImagePool,
    input_pool: ImagePool,
}

impl Inference {
    /// Prepares the filters of the network for the kernels of [`kernels::images`].
    ///
    /// # Errors
    /// If a tensor is missing or has another shape.
    pub fn new(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, SegmentationError> {
        let filters = weights.filters(&spec)?;
        let pool = ImagePool::default();
        let input_pool = ImagePool::default();
        Ok(Self { spec, filters, on_device: None, border, pool, input_pool })
    }
    /// The network with an identity as last layer: its outputs are the inputs of the classifier, all sources
    /// concatenated.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn feature_extractor(spec: NetworkSpec, weights: &Weights, border: Border) -> Result<Self, SegmentationError> {
        let mut network = Self::new(spec, weights, border)?;
        let last = network.filters.last_mut().expect("a network has layers");
        let n: usize = last.shape.in_channels.iter().sum();
        let shape = Shape { out_channels: n, kernel: [1, 1], rectify: false, ..last.shape.clone() };
        let identity: Vec<f32> = (0..n * n).map(|i| f32::from(u8::from(i / n == i % n))).collect();
        *last = Filter::new(shape, &identity, &vec![0.0; n]);
        Ok(network)
    }
    /// Runs the network with the operations of candle instead of the kernels, on any device. On a CPU they are much
    /// slower; the outputs differ by rounding.
    ///
    /// # Errors
    /// If the device cannot hold the filters.
    pub fn on_device(self, device: Device) -> Result<Self, SegmentationError> {
        let filters = self.filters.iter().map(|filter| DeviceFilter::new(filter, &device)).collect::<Result<_, _>>()?;
        Ok(Self { on_device: Some((device, filters)), ..self })
    }
    /// Architecture of the network.
    pub fn spec(&self) -> &NetworkSpec {
        &self.spec
    }
    /// Channels of the outputs.
    pub fn out_channels(&self) -> usize {
        self.filters.last().map_or(0, |filter| filter.shape.out_channels)
    }
    /// An input for [`Self::run`]. `write` writes everything except its border.
    ///
    /// # Errors
    /// If a circular image is narrower than its border.
    pub fn input(
        &self,
        height: usize,
        width: usize,
        write: impl Fn(&mut PlanesMut<'_>),
    ) -> Result<PooledImage<'_>, SegmentationError> {
        self.input_pool.written([self.spec.inputs(), height, width], self.border, write)
    }
    /// Runs the network on an image whose border is filled.
    ///
    /// # Errors
    /// If channels, rows or columns of the image do not fit the network.
    pub fn run(&self, input: &Tensor) -> Result<PooledImage<'_>, SegmentationError> {
        Ok(self.run_batch(&[input])?.remove(0))
    }
    /// Runs the network on images whose borders are filled: on all CPU threads, or as one tensor on a device. The
    /// outputs do not depend on the number of threads.
    ///
    /// # Errors
    /// The errors of [`Self::run`].
    pub fn run_batch(&self, inputs: &[&Tensor]) -> Result<Vec<PooledImage<'_>>, SegmentationError> {
        inputs.iter().try_for_each(|input| self.check(input))?;
        let Some((device, filters)) = &self.on_device else {
            return inputs.par_iter().map(|input| self.run_kernels(input)).collect();
        };
        let mut outputs = Vec::with_capacity(inputs.len());
        for of_one_size in inputs.chunk_by(|a, b| a.dims() == b.dims()) {
            outputs.extend(self.run_on(device, filters, of_one_size)?);
        }
        Ok(outputs)
    }
    fn run_kernels(&self, input: &Tensor) -> Result<PooledImage<'_>, SegmentationError> {
        let mut run = blocked::Run { filters: self.filters.iter(), border: self.border, pool: &self.pool };
        self.spec.run(&mut run, input.clone().into())
    }
    fn run_on(
        &self,
        device: &Device,
        filters: &[DeviceFilter],
        inputs: &[&Tensor],
    ) -> Result<Vec<PooledImage<'_>>, SegmentationError> {
        let mut run = on_device::Run { filters: filters.iter(), border: self.border, dropout: None };
        let batch = batch(inputs, self.spec.inputs(), device)?;
        let outputs = self.spec.run(&mut run, batch)?.to_device(&Device::Cpu)?.transpose(0, 1)?.contiguous()?;
        let to_blocks = ToBlocks { border: self.border };
        let output = |index| Ok(outputs.narrow(0, index, 1)?.apply_op1_no_bwd(&to_blocks)?.into());
        (0..inputs.len()).map(output).collect()
    }
    fn check(&self, input: &Tensor) -> Result<(), SegmentationError> {
        let [rows, columns] = self.spec.multiple_of();
        let channels = self.spec.inputs();
        let [height, width] = size_of_image(input)?;
        let fits = height.is_multiple_of(rows) && width.is_multiple_of(columns);
        if !fits || input.dims()[0] != blocks(channels) {
            let found = [input.dims()[0], height, width];
            return Err(SegmentationError::InputSize { found, channels, multiple_of: [rows, columns] });
        }
        Ok(())
    }
    /// Number of multiplications and additions for an image of this size.
    pub fn flops(&self, height: usize, width: usize) -> usize {
        struct Count(usize);
        impl Executor for Count {
            type Image = [usize; 2];
            fn convolution(&mut self, layer: &Layer, sources: &[&[usize; 2]]) -> Result<[usize; 2], SegmentationError> {
                let [height, width] = *sources[0];
                let width = layer.shape.out_width(width);
                let n_in: usize = layer.shape.in_channels.iter().sum();
                let per_pixel = 2 * n_in * layer.shape.out_channels * layer.shape.kernel[0] * layer.shape.kernel[1];
                self.0 += per_pixel * height * width;
                Ok([height, width])
            }
            fn max_pool(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], SegmentationError> {
                Ok([image[0] / factor[0], image[1] / factor[1]])
            }
            fn upsample(&mut self, image: &[usize; 2], factor: [usize; 2]) -> Result<[usize; 2], SegmentationError> {
                Ok([image[0] * factor[0], image[1] * factor[1]])
            }
            fn dropout(&mut self, image: [usize; 2], _: f32) -> Result<[usize; 2], SegmentationError> {
                Ok(image)
            }
        }
        let mut count = Count(0);
        self.spec.run(&mut count, [height, width]).map_or(0, |_| count.0)
    }
}
