//! Networks on images in training: runs and derivatives of the kernels of `kernels::images`.

use crate::bev_head::{BevHead, OfGrids};
use crate::criterion::{Criterion, RowDerivatives, known_rows};
use crate::device_network::DeviceNetwork;
use crate::device_pass::{DeviceDerivatives, DevicePass};
use crate::differential::{Differential, Recording};
use crate::network::{Derivatives, LabeledLogits, LabeledLogitsResult, Network};
use crate::pixels::Pixels;
use crate::variables::Variables;
use crate::views::{Views, inputs, truth};
use crate::{Example, TrainingError};
use candle_core::{Device, Tensor, Var};
use kernels::images::{Border, Planes};
use random::Random;
use rayon::prelude::*;
use segmentation::SegmentationError;
use segmentation::network::{Inference, NetworkSpec, Weights};
use std::collections::BTreeMap;

/// A network on images. Each of its columns holds `fold` columns of labels.
pub struct ImageNetwork {
    variables: Variables,
    fold: usize,
    border: Border,
    /// Device on which candle operations run the network and its derivatives; if `None`, the kernels run them.
    device: Option<Device>,
    bev_head: Option<BevHead>,
    /// The variables of the network and of the head.
    by_name: BTreeMap<String, Var>,
}

impl ImageNetwork {
    /// A network with initial variables. Each of its columns holds `fold` columns of labels.
    pub fn new(variables: Variables, fold: usize, border: Border) -> Self {
        let by_name = variables.by_name().clone();
        Self { variables, fold, border, device: None, bev_head: None, by_name }
    }
    /// Runs the network with candle operations on a device. On a CPU they are much slower than the kernels; the results
    /// differ by rounding. Derivatives of a bird's-eye view head are not supported there.
    #[must_use]
    pub fn on_device(self, device: Device) -> Self {
        Self { device: Some(device), ..self }
    }
    /// The network, a U-Net, with an auxiliary head in training.
    #[must_use]
    pub fn with_bev_head(mut self, head: BevHead) -> Self {
        self.by_name.extend(head.by_name());
        Self { bev_head: Some(head), ..self }
    }
    fn with_variables(&self, variables: Variables) -> Result<Self, TrainingError> {
        let network = Self { device: self.device.clone(), ..Self::new(variables, self.fold, self.border) };
        Ok(match &self.bev_head {
            Some(head) => network.with_bev_head(head.copied()?),
            None => network,
        })
    }
    fn derive_by_kernels(
        &self,
        batch: &[Example],
        views: &Views<'_>,
        criterion: &Criterion,
        mut random: Random,
    ) -> Result<Derivatives, TrainingError> {
        let network = Differential::new(self.spec(), &self.weights()?, self.border)?;
        let streams: Vec<Random> = views.images.iter().map(|_| Random::for_stream(random.bits(), 0)).collect();
        let of_image = |(image, random): (&&Planes, Random)| network.run((*image).clone(), Some(random));
        let recordings: Vec<Recording> =
            views.images.par_iter().zip(streams).map(of_image).collect::<Result<_, SegmentationError>>()?;
        let outputs: Vec<&Planes> = recordings.iter().map(Recording::output).collect();
        let Views { pixels, used, classes, n_derived, .. } = views;
        let n_classes = criterion.n_classes;
        let RowDerivatives { mut loss, by_logits } = criterion.derive_rows(pixels.gather(&outputs, used), classes)?;
        let by_outputs = pixels.scatter(&by_logits[..n_derived * n_classes], &used[..*n_derived], &outputs);
        let head = self.bev_head.as_ref().filter(|_| criterion.bev_head > 0.0);
        let of_grids = head.map(|head| head.derive(batch, &recordings, self.fold, criterion)).transpose()?.flatten();
        let (mut by_features, of_head) = match of_grids {
            Some(OfGrids { loss: of_head, by_features, gradients }) => {
                loss += of_head;
                (by_features, gradients)
            }
            None => Default::default(),
        };
        by_features.resize(recordings.len(), None);
        let backward = |((recording, by_output), by_features): ((&Recording, Planes), Option<Planes>)| match by_features
        {
            Some(by_features) => network.backward_with_features(recording, by_output, by_features),
            None => network.backward(recording, by_output),
        };
        let by_filters = recordings.par_iter().zip(by_outputs).zip(by_features).map(backward).collect();
        let mut gradients = self.variables.gradients(network.per_layer(by_filters))?;
        gradients.extend(of_head);
        // Also without labeled cells or with weight 0, because Adam keeps a state of each variable.
        for (name, var) in self.bev_head.iter().flat_map(BevHead::by_name) {
            gradients.entry(name).or_insert_with(|| vec![0.0; var.elem_count()]);
        }
        Ok(Derivatives { loss, gradients })
    }
}

impl Network for ImageNetwork {
    type Example = Example;
    type Spec = NetworkSpec;

    fn spec(&self) -> &NetworkSpec {
        self.variables.spec()
    }
    fn variables(&self) -> &BTreeMap<String, Var> {
        &self.by_name
    }
    fn set_statistic(&mut self, name: &str, _: Tensor) -> Result<(), TrainingError> {
        Err(TrainingError::NoVariable { name: name.to_owned() })
    }
    fn copied(&self) -> Result<Self, TrainingError> {
        self.with_variables(self.variables.copied()?)
    }
    fn weights(&self) -> Result<Weights, TrainingError> {
        self.variables.weights()
    }
    fn with_weights(&self, weights: &Weights) -> Result<Self, TrainingError> {
        self.with_variables(Variables::from_weights(self.spec(), weights)?)
    }
    fn derive(
        &mut self,
        batch: &[Example],
        criterion: &Criterion,
        mut random: Random,
    ) -> Result<Option<Derivatives>, TrainingError> {
        let Some(views) = Views::from_batch(batch, self.fold, criterion, &mut random) else { return Ok(None) };
        let Some(device) = &self.device else {
            return self.derive_by_kernels(batch, &views, criterion, random).map(Some);
        };
        let network = DeviceNetwork::new(self.spec(), &self.weights()?, self.border, device)?;
        let DeviceDerivatives { loss, of_layers } =
            DevicePass::new(&network, &views.images, &views.pixels).derive(criterion, &views, random)?;
        Ok(Some(Derivatives { loss, gradients: self.variables.gradients(of_layers)? }))
    }
    fn evaluator(&self, n_classes: usize) -> Result<impl Fn(&[Example]) -> LabeledLogitsResult, TrainingError> {
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
            let images = inputs(batch);
            let pixels = Pixels::from_images(&images, n_classes, self.fold);
            if let Some(network) = &on_device {
                let logits = DevicePass::new(network, &images, &pixels).logits(&known)?;
                return Ok(Some(LabeledLogits { logits, classes }));
            }
            let inputs = images.iter().map(|image| image.to_tensor()).collect::<Result<Vec<_>, _>>()?;
            let results = network.run_batch(&inputs.iter().collect::<Vec<_>>())?;
            let outputs = results.iter().map(|result| Planes::from_tensor(result, network.out_channels()));
            let outputs = outputs.collect::<Result<Vec<_>, _>>()?;
            let logits = pixels.gather(&outputs.iter().collect::<Vec<_>>(), &known);
            let logits = Tensor::from_vec(logits, (known.len(), n_classes), &Device::Cpu)?;
            Ok(Some(LabeledLogits { logits, classes }))
        })
    }
}
