//! Loss and derivatives of a batch by the operations of candle on a device, a GPU for example, instead of the kernels.

use crate::criterion::Criterion;
use crate::pixels::Pixels;
use crate::{Example, TrainingError};
use candle_core::{Device, Tensor};
use random::Random;
use segmentation::engine::Border;
use segmentation::network::{DeviceNetwork, NetworkSpec, Weights, batch};
use std::collections::BTreeMap;

/// Derivatives with respect to the weights and the biases of a layer, in the order of `PyTorch`.
pub(crate) type OfLayer = (Vec<f32>, Vec<f32>);

/// What a pass needs to know of the training.
pub(crate) struct DevicePass<'a> {
    pub(crate) spec: &'a NetworkSpec,
    pub(crate) border: Border,
    pub(crate) pixels: &'a Pixels,
    pub(crate) criterion: &'a Criterion,
    pub(crate) device: &'a Device,
}

impl DevicePass<'_> {
    /// Loss of the pixels `known`, of classes `classes`, and its derivatives.
    pub(crate) fn derive(
        &self,
        weights: &Weights,
        examples: &[Example],
        (known, classes): (&[u32], &[u8]),
        mut random: Random,
    ) -> Result<(f64, Vec<OfLayer>), TrainingError> {
        let network = DeviceNetwork::new(self.spec, weights, self.border, self.device)?;
        // Images of one size are one tensor.
        let mut of_sizes: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
        for (index, example) in examples.iter().enumerate() {
            of_sizes.entry([example.input.height(), example.input.width()]).or_default().push(index);
        }
        let mut rows = Vec::with_capacity(of_sizes.len());
        let mut first_rows = vec![0; examples.len()];
        let mut places = vec![(0, 0); examples.len()];
        let mut n_rows = 0;
        for ([height, width], of_size) in &of_sizes {
            let images =
                of_size.iter().map(|&index| examples[index].input.to_tensor()).collect::<Result<Vec<_>, _>>()?;
            let images = batch(&images.iter().collect::<Vec<_>>(), self.spec.channels().0, self.device)?;
            rows.push(self.rows(&network.run(images, &mut random)?)?);
            for (place, &index) in of_size.iter().enumerate() {
                (first_rows[index], places[index]) = (n_rows, (place, of_size.len()));
            }
            n_rows += of_size.len() * height * width * self.pixels.fold;
        }
        let logits = Tensor::cat(&rows, 0)?;
        let of_pixel = |&pixel: &u32| {
            let [image, row, column, part] = self.pixels.place(pixel, |image| examples[image].input.width());
            let ((place, n_images), input) = (places[image], &examples[image].input);
            let of_part = (part * n_images + place) * input.height() + row;
            (first_rows[image] + of_part * input.width() + column) as u32
        };
        let known_rows: Vec<u32> = known.iter().map(of_pixel).collect();
        let (loss, by_rows) = self.loss(&logits, n_rows, &known_rows, classes)?;
        // A sum with the derivatives of the loss: candle differentiates the network with it.
        let derived = (&logits * by_rows)?.sum_all()?.backward()?;
        let values = |var: &Tensor| match derived.get(var) {
            Some(by) => by.flatten_all()?.to_vec1::<f32>(),
            None => Ok(vec![0.0; var.elem_count()]),
        };
        let of_layers = network.variables().iter().map(|[weights, biases]| Ok((values(weights)?, values(biases)?)));
        Ok((loss, of_layers.collect::<Result<_, TrainingError>>()?))
    }
    /// One row for each pixel: parts of a folded column outermost, then images, rows, columns.
    fn rows(&self, output: &Tensor) -> Result<Tensor, TrainingError> {
        let (fold, n_classes) = (self.pixels.fold, self.pixels.n_classes);
        let rows = output.reshape((fold, n_classes, ()))?.transpose(1, 2)?.contiguous()?;
        Ok(rows.reshape(((), n_classes))?)
    }
    /// The loss of these rows, and its derivatives with respect to all rows.
    fn loss(
        &self,
        logits: &Tensor,
        n_rows: usize,
        known_rows: &[u32],
        classes: &[u8],
    ) -> Result<(f64, Tensor), TrainingError> {
        let index = Tensor::new(known_rows, self.device)?;
        let (loss, by_known) = self.criterion.derive(&logits.detach().index_select(&index, 0)?, classes)?;
        // The other rows take the zeros after the last. Adding rows at their places would be slow on a GPU.
        let mut sources = vec![known_rows.len() as u32; n_rows];
        for (source, &row) in known_rows.iter().enumerate() {
            sources[row as usize] = source as u32;
        }
        let zeros = Tensor::zeros((1, self.pixels.n_classes), by_known.dtype(), self.device)?;
        let padded = Tensor::cat(&[&by_known, &zeros], 0)?;
        Ok((loss, padded.index_select(&Tensor::from_vec(sources, n_rows, self.device)?, 0)?))
    }
}
