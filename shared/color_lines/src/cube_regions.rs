//! Regions of the cells of cubes, for consecutive frames.

use crate::{ColorLinesError, Fit, Image, Model, Settings};
use messages::CubeHeader;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Models of the cubes of several cameras. A model serves several consecutive frames of its camera; regions of different
/// models have different numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CubeRegions {
    /// Model of each camera, by camera index.
    models: BTreeMap<u32, SharedModel>,
    /// Number of regions of all models so far.
    n_regions: u32,
}

/// A model of some frames of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SharedModel {
    model: Model,
    /// Number of regions of the models before it.
    n_before: u32,
    /// Number of frames that used it.
    n_frames: u32,
}

/// Settings of the division of cubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeSettings {
    /// Settings of a model.
    pub model: Settings,
    /// Number of frames that share a model, which is fitted to the first of them.
    pub frames_per_model: u32,
    /// Whether cells get the mean spectrum of their region.
    pub simplifies: bool,
}

impl CubeRegions {
    /// Uses the given models of cameras. They serve all frames if `frames_per_model` is `u32::MAX`.
    pub fn from_models(models: impl IntoIterator<Item = (u32, Model)>) -> Self {
        let mut regions = Self::default();
        for (camera, model) in models {
            regions.insert(camera, model, 0);
        }
        regions
    }

    /// Writes the number of the region of each cell, 0 = no region: cells without a valid value in all usable bands.
    /// Reflectances change only if the settings request simplified cubes.
    pub fn divide(
        &mut self,
        cube: &CubeHeader,
        settings: &CubeSettings,
        reflectances: &mut [f32],
        masks: &[u32],
        regions: &mut [u32],
    ) -> Result<(), ColorLinesError> {
        regions.fill(0);
        let bands = UsableBands::from_header(cube);
        let values = bands.values(reflectances, masks);
        let image = Image::new([cube.width as usize, cube.height as usize], bands.numbers.len(), &values)?;
        let (shared, labels) = self.labels(cube.camera, &image, settings)?;
        if settings.simplifies {
            bands.replace(reflectances, &shared.model.simplified(&image, &labels)?);
        }
        for (region, label) in regions.iter_mut().zip(&labels).filter(|(_, label)| **label != 0) {
            *region = shared.n_before + label;
        }
        Ok(())
    }

    /// Checks models from a file.
    pub fn check(&self) -> Result<(), ColorLinesError> {
        self.models.values().try_for_each(|shared| shared.model.check())
    }

    /// The model of a frame and its labels.
    fn labels(
        &mut self,
        camera: u32,
        image: &Image<'_>,
        settings: &CubeSettings,
    ) -> Result<(&SharedModel, Vec<u32>), ColorLinesError> {
        let is_fresh = |shared: &SharedModel| shared.n_frames < settings.frames_per_model;
        if let Some(shared) = self.models.get_mut(&camera).filter(|shared| is_fresh(shared)) {
            let labels = shared.model.labels(image)?;
            shared.n_frames += 1;
            return Ok((&self.models[&camera], labels));
        }
        let Fit { model, labels, .. } = Model::fit(image, &settings.model)?;
        self.insert(camera, model, 1);
        Ok((&self.models[&camera], labels))
    }

    /// Assigns this model to the next frames of the camera. Its regions get the next numbers.
    fn insert(&mut self, camera: u32, model: Model, n_frames: u32) {
        let n_before = self.n_regions;
        self.n_regions += model.regions.len() as u32;
        self.models.insert(camera, SharedModel { model, n_before, n_frames });
    }
}

/// The bands of a cube that have valid values.
struct UsableBands {
    numbers: Vec<usize>,
    n_cells: usize,
    valid: u32,
}

impl UsableBands {
    fn from_header(cube: &CubeHeader) -> Self {
        let valid = cube.valid_bands;
        let numbers = (0..cube.n_bands as usize).filter(|band| valid >> band & 1 == 1).collect();
        Self { numbers, n_cells: cube.width as usize * cube.height as usize, valid }
    }

    /// Reflectances of these bands, band-sequential: NaN in cells with a band that was not measured.
    fn values(&self, reflectances: &[f32], masks: &[u32]) -> Vec<f32> {
        let of_band = |band: &usize| {
            let plane = &reflectances[band * self.n_cells..][..self.n_cells];
            let is_whole = masks.iter().map(|mask| mask & self.valid == self.valid);
            plane.iter().zip(is_whole).map(|(value, is_whole)| if is_whole { *value } else { f32::NAN })
        };
        self.numbers.iter().flat_map(of_band).collect()
    }

    /// Replaces the reflectances by these values, except where they are NaN.
    fn replace(&self, reflectances: &mut [f32], values: &[f32]) {
        for (band, values) in self.numbers.iter().zip(values.chunks_exact(self.n_cells)) {
            let plane = &mut reflectances[band * self.n_cells..][..self.n_cells];
            for (to, value) in plane.iter_mut().zip(values).filter(|(_, value)| !value.is_nan()) {
                *to = *value;
            }
        }
    }
}
