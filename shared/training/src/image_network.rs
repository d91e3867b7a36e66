//! Networks on images in training: runs and derivatives of the kernels of `segmentation::engine`.

use crate::criterion::{Criterion, known_rows};
use crate::device_pass::{DevicePass, OfLayer};
use crate::differential::{Differential, Recording};
use crate::network::{Derivatives, LabeledLogits, Network};
use crate::pixels::Pixels;
use crate::variables::Variables;
use crate::{Example, TrainingError};
use candle_core::{Device, Tensor, Var};
use random::Random;
use rayon::prelude::*;
use segmentation::SegmentationError;
use segmentation::engine::{Border, Feature, Planes};
use segmentation::network::{DeviceNetwork, Inference, NetworkSpec, Weights};
use std::collections::BTreeMap;

/// A network on images. One of its columns holds `fold` columns of labels.
pub struct ImageNetwork {
    variables: Variables,
    fold: usize,
    border: Border,
    /// Where the operations of candle run the network and its derivatives; without it, the kernels do.
    device: Option<Device>,
}

impl ImageNetwork {
    /// A network with initial variables. One of its columns holds `fold` columns of labels.
    pub fn new(variables: Variables, fold: usize, border: Border) -> Self {
        Self { variables, fold, border, device: None }
    }
    /// The network on the operations of candle on a device. On a CPU they are much slower than the kernels; the
    /// results differ by rounding.
    #[must_use]
    pub fn on_device(self, device: Device) -> Self {
        Self { device: Some(device), ..self }
    }
    fn with_variables(&self, variables: Variables) -> Self {
        Self { variables, fold: self.fold, border: self.border, device: self.device.clone() }
    }
    fn pixels(&self, n_classes: usize, batch: &[Example]) -> Pixels {
        let mut end = 0;
        let ends = batch.iter().map(|example| {
            end += example.truth.len();
            end
        });
        Pixels { n_classes, fold: self.fold, ends: ends.collect() }
    }
}

/// Classes of all pixels of a batch.
fn truth(batch: &[Example]) -> Vec<u8> {
    batch.iter().flat_map(|example| example.truth.iter().copied()).collect()
}

impl ImageNetwork {
    fn derive_by_kernels(
        &self,
        pixels: &Pixels,
        criterion: &Criterion,
        batch: &[Example],
        (known, classes): (&[u32], &[u8]),
        mut random: Random,
    ) -> Result<(f64, Vec<OfLayer>), TrainingError> {
        let network = Differential::new(self.spec(), &self.weights()?, self.border)?;
        let streams: Vec<Random> = batch.iter().map(|_| Random::of_stream(random.bits(), 0)).collect();
        let of_example = |(example, random): (&Example, Random)| network.run(example.input.clone(), Some(random));
        let recordings: Vec<Recording> =
            batch.par_iter().zip(streams).map(of_example).collect::<Result<_, SegmentationError>>()?;
        let outputs: Vec<&Planes> = recordings.iter().map(Recording::output).collect();
        let (loss, by_logits) = criterion.derive_rows(pixels.gather(&outputs, known), classes)?;
        let by_outputs = pixels.scatter(&by_logits, known, &outputs);
        let backward = |(recording, by_output): (&Recording, Planes)| network.backward(recording, by_output);
        let by_filters: Vec<Vec<Vec<Feature>>> = recordings.par_iter().zip(by_outputs).map(backward).collect();
        let layers = self.spec().layers();
        let of_layers = layers.iter().zip(sum_of(by_filters)).map(|(layer, packed)| layer.shape.unpacked(&packed));
        Ok((loss, of_layers.collect()))
    }
}

impl Network for ImageNetwork {
    type Example = Example;
    type Spec = NetworkSpec;

    fn spec(&self) -> &NetworkSpec {
        self.variables.spec()
    }
    fn variables(&self) -> &BTreeMap<String, Var> {
        self.variables.by_name()
    }
    fn set_statistic(&mut self, name: &str, _: Tensor) -> Result<(), TrainingError> {
        Err(TrainingError::NoVariable { name: name.to_owned() })
    }
    fn copied(&self) -> Result<Self, TrainingError> {
        Ok(self.with_variables(self.variables.copied()?))
    }
    fn weights(&self) -> Result<Weights, TrainingError> {
        self.variables.weights()
    }
    fn with_weights(&self, weights: &Weights) -> Result<Self, TrainingError> {
        Ok(self.with_variables(Variables::from_weights(self.spec(), weights)?))
    }
    fn derive(
        &mut self,
        batch: &[Example],
        criterion: &Criterion,
        mut random: Random,
    ) -> Result<Option<Derivatives>, TrainingError> {
        let truth = truth(batch);
        let known = criterion.known_rows(&truth, &mut random);
        if known.is_empty() {
            return Ok(None);
        }
        let pixels = self.pixels(criterion.n_classes, batch);
        let classes: Vec<u8> = known.iter().map(|&pixel| truth[pixel as usize]).collect();
        let (loss, of_layers) = if let Some(device) = &self.device {
            let network = DeviceNetwork::new(self.spec(), &self.weights()?, self.border, device)?;
            DevicePass::new(&network, batch, &pixels).derive(criterion, (&known, &classes), random)?
        } else {
            self.derive_by_kernels(&pixels, criterion, batch, (&known, &classes), random)?
        };
        Ok(Some(Derivatives { loss, gradients: self.variables.gradients(of_layers)? }))
    }
    fn evaluator(&self, n_classes: usize) -> Result<impl Fn(&[Example]) -> LabeledLogits, TrainingError> {
        let weights = self.weights()?;
        let on_device =
            self.device.as_ref().map(|device| DeviceNetwork::new(self.spec(), &weights, self.border, device));
        let on_device = on_device.transpose()?;
        let network = Inference::new(self.spec().clone(), &weights, self.border)?;
        Ok(move |batch: &[Example]| {
            let truth = truth(batch);
            let known = known_rows(&truth);
            if known.is_empty() {
                return Ok(None);
            }
            let classes: Vec<u8> = known.iter().map(|&pixel| truth[pixel as usize]).collect();
            let pixels = self.pixels(n_classes, batch);
            if let Some(network) = &on_device {
                return Ok(Some((DevicePass::new(network, batch, &pixels).logits(&known)?, classes)));
            }
            let inputs = batch.iter().map(|example| example.input.to_tensor()).collect::<Result<Vec<_>, _>>()?;
            let results = network.run_batch(&inputs.iter().collect::<Vec<_>>())?;
            let outputs = results.iter().map(|result| Planes::from_tensor(result, network.out_channels()));
            let outputs = outputs.collect::<Result<Vec<_>, _>>()?;
            let logits = pixels.gather(&outputs.iter().collect::<Vec<_>>(), &known);
            let logits = Tensor::from_vec(logits, (known.len(), n_classes), &Device::Cpu)?;
            Ok(Some((logits, classes)))
        })
    }
}

/// Sums by layer, row and lane, in the order of the images.
fn sum_of(by_images: Vec<Vec<Vec<Feature>>>) -> Vec<Vec<Feature>> {
    let mut images = by_images.into_iter();
    let mut sum = images.next().unwrap_or_default();
    for by_layer in images {
        for (sum, rows) in sum.iter_mut().zip(by_layer) {
            let values = sum.as_flattened_mut().iter_mut().zip(rows.as_flattened());
            values.for_each(|(sum, value)| *sum += value);
        }
    }
    sum
}
