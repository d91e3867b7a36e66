//! Training of networks on images.

use super::recipe::Recipe;
use super::sweep_dataset::SweepDataset;
use super::{Calibration, SharedRecipe, TrainingRecipe};
use command_line::say_error;
use kernels::images::Border;
use segmentation::ComputeDevice;
use segmentation::network::{CLASS_LAYER, Weights};
use segmentation::spherical::{LoadedModel, Settings, SphericalModel};
use std::path::Path;
use training::{BevHead, ClassLayer, ImageNetwork, Variables, match_classes};

impl TrainingRecipe for Recipe {
    type Network = ImageNetwork;
    type Data = SweepDataset;

    fn shared(&self) -> SharedRecipe<'_> {
        let model = &self.model;
        SharedRecipe {
            data: &self.data,
            train: &self.train,
            frozen: &model.frozen,
            classes: &model.classes,
            start_share: model.start_share,
            temperature: model.temperature,
        }
    }
    fn network(&self, folder: &Path, device: ComputeDevice) -> anyhow::Result<ImageNetwork> {
        let settings = self.settings()?;
        let variables = Variables::random(&settings.network, self.train.seed)?;
        if let Some(start) = &self.model.start {
            let start = folder.join(start);
            let LoadedModel { model, mut weights } = SphericalModel::load(&start)?;
            let tensors = &["weight", "bias"].map(|kind| format!("{CLASS_LAYER}.{kind}"));
            let n_classes = match_classes(
                &mut weights,
                class_layer(tensors, model.settings()),
                &variables.weights()?,
                class_layer(tensors, &settings),
            );
            let n_taken = variables.begin_with(&weights)?;
            let n_layers = settings.network.layers().len();
            anyhow::ensure!(
                n_taken > 0,
                "{}: no layer matches a layer of the recipe in name and shape",
                start.display()
            );
            say_error!(
                "starting from {n_taken} of {n_layers} layers of {}, and {n_classes} of {} classes",
                start.display(),
                settings.classes.len()
            );
        }
        let mut network = ImageNetwork::new(variables, settings.fold, Border::Circular);
        if let Some(device) = device.open()? {
            anyhow::ensure!(
                self.train.bev_head == 0.0,
                "[train] bev_head: must be 0 for --device cuda, or use --device cpu"
            );
            network = network.on_device(device);
        }
        if self.train.bev_head > 0.0 {
            network = network.with_bev_head(self.bev_head(&settings)?);
        }
        Ok(network)
    }
    fn empty_data(&self, folder: &Path, _: bool) -> anyhow::Result<SweepDataset> {
        SweepDataset::new(self, folder)
    }
    fn model(&self, weights: &Weights, calibration: Calibration) -> anyhow::Result<Vec<u8>> {
        let Calibration { temperature, ground_intensities } = calibration;
        Ok(Settings { temperature, ground_intensities, ..self.settings()? }.to_bytes(weights)?)
    }
}

impl Recipe {
    /// A head on the features of the last layer before the classes, with random weights.
    fn bev_head(&self, settings: &Settings) -> anyhow::Result<BevHead> {
        let layers = settings.network.layers();
        let inputs = layers.last().map_or(0, |layer| layer.shape.in_channels[0]);
        // A different seed than the network, so that the weights differ.
        Ok(BevHead::random(inputs, settings.classes.len(), self.train.seed ^ 1 << 62)?)
    }
}

fn class_layer<'a>([weight, bias]: &'a [String; 2], settings: &'a Settings) -> ClassLayer<'a> {
    ClassLayer { tensors: [weight, bias], classes: &settings.classes, fold: settings.fold }
}
