//! Loading of models by the architecture in their file.

use crate::ground::{self, GroundQuasiFlat};
use crate::model_file::ModelFile;
use crate::points::{self, PointFeature, PointModel, PointSettings};
use crate::segmenter::{CellSegmenter, Segmenter};
use crate::spherical::{self, AskedColumns, GroundUse, Options, SphericalModel};
use crate::{Fused, SegmentationError};
use std::path::Path;

/// Names of the architectures.
const KNOWN: &str = "ground_quasi_flat, points, spherical";

/// The columns that a model file reads beside the points of a submap.
///
/// # Errors
/// If the file or its settings cannot be read.
pub fn asked_columns(path: &Path) -> Result<AskedColumns, SegmentationError> {
    let file = ModelFile::read(path)?;
    match file.card.architecture.as_str() {
        spherical::ARCHITECTURE => Ok(file.settings::<spherical::Settings>()?.features.columns()),
        points::ARCHITECTURE => {
            let features = file.settings::<PointSettings>()?.features;
            Ok(AskedColumns { color: features.contains(&PointFeature::ColorHeight), ..AskedColumns::default() })
        }
        _ => Ok(AskedColumns::default()),
    }
}

/// Reads a model file.
///
/// # Errors
/// If the file is truncated, its architecture or version is unknown, a setting or tensor is invalid, or the
/// device of the options cannot be used.
pub fn load(path: &Path, options: &Options) -> Result<Box<dyn Segmenter>, SegmentationError> {
    let file = ModelFile::read(path)?;
    match file.card.architecture.as_str() {
        ground::ARCHITECTURE => Ok(Box::new(GroundQuasiFlat::from_file(&file)?)),
        _ => Ok(of_cells(&file, options)?),
    }
}

/// Reads two model files to be fused.
///
/// # Errors
/// As [`load`], and if one of them knows no probabilities or removes the ground first, or their classes differ.
pub fn load_fused(first: &Path, second: &Path, options: &Options) -> Result<Fused, SegmentationError> {
    let [first, of_second] = [first, second].map(|path| {
        let file = ModelFile::read(path)?;
        let refused = |reason: &str| {
            let reason = format!("{reason}, so it cannot be fused");
            Err(SegmentationError::Card { path: path.into(), reason })
        };
        match file.card.architecture.as_str() {
            ground::ARCHITECTURE => refused("the model knows no probabilities"),
            spherical::ARCHITECTURE if file.settings::<spherical::Settings>()?.ground == GroundUse::Removed => {
                refused("the model removes the ground first")
            }
            _ => of_cells(&file, options),
        }
    });
    Fused::new(first?, of_second?, second)
}

/// A model that knows probabilities.
fn of_cells(file: &ModelFile, options: &Options) -> Result<Box<dyn CellSegmenter>, SegmentationError> {
    match file.card.architecture.as_str() {
        spherical::ARCHITECTURE => Ok(Box::new(SphericalModel::from_file(file)?.with_options(*options)?)),
        points::ARCHITECTURE => Ok(Box::new(PointModel::from_file(file)?.with_options(*options)?)),
        other => {
            Err(SegmentationError::Architecture { path: file.path.clone(), found: other.to_owned(), known: KNOWN })
        }
    }
}
