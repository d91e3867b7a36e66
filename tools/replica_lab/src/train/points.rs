//! Training of networks on points.

use super::point_dataset::PointDataset;
use super::point_recipe::PointRecipe;
use super::{Calibration, SharedRecipe, TrainingRecipe};
use command_line::say_error;
use segmentation::network::Weights;
use segmentation::points::{PointModel, PointSettings};
use segmentation::{ComputeDevice, SegmentationError};
use std::path::Path;
use training::{ClassLayer, Network, PointNetwork, match_classes};

impl TrainingRecipe for PointRecipe {
    type Network = PointNetwork;
    type Data = PointDataset;

    fn shared(&self) -> SharedRecipe<'_> {
        let model = &self.model;
        SharedRecipe {
            data: &self.data,
            train: &self.train,
            frozen: &model.frozen,
            classes: &model.classes,
            start_share: 0.0,
            temperature: model.temperature,
        }
    }
    fn network(&self, folder: &Path, device: ComputeDevice) -> anyhow::Result<PointNetwork> {
        if device == ComputeDevice::Cuda {
            return Err(SegmentationError::PointsOnGpu.into());
        }
        let settings = self.settings()?;
        let mut network = PointNetwork::random(&settings.network, self.train.seed)?;
        if let Some(start) = &self.model.start {
            let start = folder.join(start);
            let model = PointModel::load(&start)?;
            let mut weights = model.weights()?;
            let n_classes =
                match_classes(&mut weights, class_layer(model.settings()), &network.weights()?, class_layer(&settings));
            let n_taken = network.begin_with(&weights)?;
            let n_tensors = network.n_tensors();
            anyhow::ensure!(n_taken > 0, "{}: no tensor matches one of the recipe in name and shape", start.display());
            say_error!(
                "starting from {n_taken} of {n_tensors} tensors of {}, and {n_classes} of {} classes",
                start.display(),
                settings.classes.len()
            );
        }
        Ok(network)
    }
    fn empty_data(&self, folder: &Path, validation: bool) -> anyhow::Result<PointDataset> {
        PointDataset::new(self, folder, validation)
    }
    fn model(&self, weights: &Weights, calibration: Calibration) -> anyhow::Result<Vec<u8>> {
        let Calibration { temperature, ground_intensities } = calibration;
        Ok(PointSettings { temperature, ground_intensities, ..self.settings()? }.to_bytes(weights)?)
    }
}

fn class_layer(settings: &PointSettings) -> ClassLayer<'_> {
    ClassLayer { tensors: settings.network.class_tensors(), classes: &settings.classes, fold: 1 }
}
