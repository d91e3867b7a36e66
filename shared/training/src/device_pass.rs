//! Logits and derivatives of a batch, computed by candle operations on a device such as a GPU instead of the kernels.
//!
//! To reduce synchronization with the device, the host receives its data in one tensor.

use crate::TrainingError;
use crate::criterion::{Criterion, LogitDerivatives};
use crate::device_network::DeviceNetwork;
use crate::pixels::Pixels;
use crate::views::Views;
use candle_core::{Tensor, Var};
use kernels::images::{PlainFilter, Planes};
use random::Random;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Loss of a batch and its derivatives.
pub(crate) struct DeviceDerivatives {
    pub(crate) loss: f64,
    /// Derivatives with respect to the filters of the layers.
    pub(crate) of_layers: Vec<PlainFilter>,
}

/// A batch on a device.
pub(crate) struct DevicePass<'a> {
    network: &'a DeviceNetwork,
    images: &'a [&'a Planes],
    pixels: &'a Pixels,
    /// Indices of images by rows and columns: images of one size form one tensor.
    of_sizes: BTreeMap<[usize; 2], Vec<usize>>,
}

impl<'a> DevicePass<'a> {
    pub(crate) fn new(network: &'a DeviceNetwork, images: &'a [&'a Planes], pixels: &'a Pixels) -> Self {
        let mut of_sizes: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
        for (index, image) in images.iter().enumerate() {
            of_sizes.entry([image.height(), image.width()]).or_default().push(index);
        }
        Self { network, images, pixels, of_sizes }
    }
    /// The logits of these pixels.
    pub(crate) fn logits(&self, known: &[u32]) -> Result<Tensor, TrainingError> {
        let index = Tensor::new(self.rows_of(known).as_slice(), self.network.device())?;
        Ok(self.run(None)?.index_select(&index, 0)?)
    }
    /// Loss of the pixels of views, and its derivatives.
    pub(crate) fn derive(
        &self,
        criterion: &Criterion,
        views: &Views<'_>,
        mut random: Random,
    ) -> Result<DeviceDerivatives, TrainingError> {
        let logits = self.run(Some(&mut random))?;
        let used_rows = self.rows_of(&views.used);
        let index = Tensor::new(used_rows.as_slice(), self.network.device())?;
        let LogitDerivatives { loss, by_logits: by_used } =
            criterion.derive(&logits.detach().index_select(&index, 0)?, &views.classes)?;
        // The other rows get the zeros after the last row. Adding rows at their positions would be slow on a GPU.
        let n_rows = logits.dim(0)?;
        let mut sources = vec![used_rows.len() as u32; n_rows];
        for (source, &row) in used_rows[..views.n_derived].iter().enumerate() {
            sources[row as usize] = source as u32;
        }
        let zeros = Tensor::zeros((1, by_used.dim(1)?), by_used.dtype(), self.network.device())?;
        let by_rows = Tensor::cat(&[&by_used, &zeros], 0)?;
        let by_rows = by_rows.index_select(&Tensor::from_vec(sources, n_rows, self.network.device())?, 0)?;
        // A sum weighted with the derivatives of the loss, so that candle differentiates the network.
        let derived = (&logits * by_rows)?.sum_all()?.backward()?;
        let mut wanted = vec![loss.reshape(1)?];
        for variable in self.network.variables().iter().flatten() {
            wanted
                .push(derived.get(variable).map_or_else(|| variable.zeros_like(), |by| Ok(by.clone()))?.flatten_all()?);
        }
        let values = Tensor::cat(&wanted, 0)?.to_vec1::<f32>()?;
        let loss = f64::from(values[0]);
        let mut values = &values[1..];
        let mut take = |n: usize| {
            let (taken, rest) = values.split_at(n);
            values = rest;
            taken.to_vec()
        };
        let of_layer = |[weights, biases]: &[Var; 2]| PlainFilter {
            weights: take(weights.elem_count()),
            biases: take(biases.elem_count()),
        };
        Ok(DeviceDerivatives { loss, of_layers: self.network.variables().iter().map(of_layer).collect() })
    }
    /// Logits of all pixels, one row for each: sizes of images outermost, then parts of a folded column, images, rows,
    /// columns.
    fn run(&self, mut dropout: Option<&mut Random>) -> Result<Tensor, TrainingError> {
        let fold = self.pixels.fold;
        let n_classes = self.pixels.n_classes;
        let mut rows = Vec::with_capacity(self.of_sizes.len());
        for of_size in self.of_sizes.values() {
            let tensors = of_size.par_iter().map(|&index| self.images[index].to_tensor());
            let tensors = tensors.collect::<Result<Vec<_>, _>>()?;
            let output = self.network.run(&tensors.iter().collect::<Vec<_>>(), dropout.as_deref_mut())?;
            let output = output.reshape((fold, n_classes, ()))?.transpose(1, 2)?.contiguous()?;
            rows.push(output.reshape(((), n_classes))?);
        }
        Ok(Tensor::cat(&rows, 0)?)
    }
    /// The rows of these pixels among the logits of all pixels.
    fn rows_of(&self, known: &[u32]) -> Vec<u32> {
        let mut first_row = 0;
        // For each image: first row of the images of its size, index among them, and their number.
        let mut places = vec![[0; 3]; self.images.len()];
        for ([height, width], of_size) in &self.of_sizes {
            for (place, &index) in of_size.iter().enumerate() {
                places[index] = [first_row, place, of_size.len()];
            }
            first_row += of_size.len() * height * width * self.pixels.fold;
        }
        let of_pixel = |&pixel: &u32| {
            let [image, row, column, part] = self.pixels.place(pixel, |image| self.images[image].width());
            let [first_row, place, n_images] = places[image];
            let input = self.images[image];
            (first_row + ((part * n_images + place) * input.height() + row) * input.width() + column) as u32
        };
        known.par_iter().map(of_pixel).collect()
    }
}
