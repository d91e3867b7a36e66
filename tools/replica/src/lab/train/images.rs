//! Training of networks on images.

use super::recipe::Recipe;
use super::sweep_dataset::SweepDataset;
use super::{Calibration, SharedRecipe, TrainingRecipe};
use segmentation::engine::Border;
use segmentation::network::Weights;
use segmentation::spherical::{Settings, SphericalModel};
use std::path::Path;
use training::{ImageNetwork, Variables};

impl TrainingRecipe for Recipe {
    type Network = ImageNetwork;
    type Data = SweepDataset;

    fn shared(&self) -> SharedRecipe<'_> {
        let model = &self.model;
        SharedRecipe { data: &self.data, train: &self.train, frozen: &model.frozen, classes: &model.classes }
    }
    fn network(&self, folder: &Path) -> anyhow::Result<ImageNetwork> {
        let settings = self.settings()?;
        let variables = Variables::random(&settings.network, self.train.seed)?;
        if let Some(start) = &self.model.start {
            let start = folder.join(start);
            let (_, weights) = SphericalModel::load(&start)?;
            let (n_taken, n_layers) = (variables.begin_with(&weights)?, settings.network.layers().len());
            anyhow::ensure!(
                n_taken > 0,
                "{}: no layer matches a layer of the recipe in name and shape",
                start.display()
            );
            eprintln!("starting from {n_taken} of {n_layers} layers of {}", start.display());
        }
        Ok(ImageNetwork::new(variables, settings.fold, Border::Circular))
    }
    fn empty_data(&self, folder: &Path, _: bool) -> anyhow::Result<SweepDataset> {
        SweepDataset::new(self, folder)
    }
    fn model(&self, weights: &Weights, calibration: Calibration) -> anyhow::Result<Vec<u8>> {
        let Calibration { temperature, ground_intensities } = calibration;
        Ok(Settings { temperature, ground_intensities, ..self.settings()? }.to_bytes(weights)?)
    }
}
