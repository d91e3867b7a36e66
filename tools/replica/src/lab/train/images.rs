//! Training of networks on images.

use super::recipe::Recipe;
use super::sweep_dataset::SweepDataset;
use super::{Calibration, SharedRecipe, TrainingRecipe};
use segmentation::ComputeDevice;
use segmentation::engine::Border;
use segmentation::network::{CLASS_LAYER, Weights};
use segmentation::spherical::{Settings, SphericalModel};
use std::path::Path;
use training::{ClassLayer, ImageNetwork, Variables, match_classes};

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
            let (model, mut weights) = SphericalModel::load(&start)?;
            let tensors = &["weight", "bias"].map(|kind| format!("{CLASS_LAYER}.{kind}"));
            let n_classes = match_classes(
                (&mut weights, class_layer(tensors, model.settings())),
                (&variables.weights()?, class_layer(tensors, &settings)),
            );
            let (n_taken, n_layers) = (variables.begin_with(&weights)?, settings.network.layers().len());
            anyhow::ensure!(
                n_taken > 0,
                "{}: no layer matches a layer of the recipe in name and shape",
                start.display()
            );
            eprintln!(
                "starting from {n_taken} of {n_layers} layers of {}, and {n_classes} of {} classes",
                start.display(),
                settings.classes.len()
            );
        }
        let network = ImageNetwork::new(variables, settings.fold, Border::Circular);
        Ok(match device.open()? {
            Some(device) => network.on_device(device),
            None => network,
        })
    }
    fn empty_data(&self, folder: &Path, _: bool) -> anyhow::Result<SweepDataset> {
        SweepDataset::new(self, folder)
    }
    fn model(&self, weights: &Weights, calibration: Calibration) -> anyhow::Result<Vec<u8>> {
        let Calibration { temperature, ground_intensities } = calibration;
        Ok(Settings { temperature, ground_intensities, ..self.settings()? }.to_bytes(weights)?)
    }
}

fn class_layer<'a>([weight, bias]: &'a [String; 2], settings: &'a Settings) -> ClassLayer<'a> {
    ClassLayer { tensors: [weight, bias], classes: &settings.classes, fold: settings.fold }
}
