//! Loads models by the architecture in their file.

use crate::ground_quasi_flat::{self, GroundQuasiFlat};
use crate::model_file::ModelFile;
use crate::options::Options;
use crate::points::{self, PointFeature, PointModel, PointSettings};
use crate::segmenter::Segmenter;
use crate::spherical::{self, AskedColumns, SphericalModel};
use crate::{Fused, SegmentationError, fused};
use std::path::Path;

/// The columns that a model file reads in addition to the points of a submap.
///
/// # Errors
/// If the file or its settings cannot be read.
pub fn asked_columns(path: &Path) -> Result<AskedColumns, SegmentationError> {
    columns_of(&ModelFile::read(path)?)
}

fn columns_of(file: &ModelFile) -> Result<AskedColumns, SegmentationError> {
    match file.card.architecture.as_str() {
        spherical::ARCHITECTURE => Ok(file.settings::<spherical::Settings>()?.features.columns()),
        points::ARCHITECTURE => {
            let features = file.settings::<PointSettings>()?.features;
            Ok(AskedColumns { color: features.contains(&PointFeature::ColorHeight), ..AskedColumns::default() })
        }
        fused::ARCHITECTURE => {
            let [first, second] = fused::parts(file)?;
            Ok(columns_of(&first)?.and(columns_of(&second)?))
        }
        _ => Ok(AskedColumns::default()),
    }
}

/// What users of a model file must know, such as restrictions by its training data. A fused model has the notices of both models.
///
/// # Errors
/// If the file or its settings cannot be read.
pub fn notices(path: &Path) -> Result<Vec<String>, SegmentationError> {
    notices_of(&ModelFile::read(path)?)
}

fn notices_of(file: &ModelFile) -> Result<Vec<String>, SegmentationError> {
    let of_file = match file.card.architecture.as_str() {
        spherical::ARCHITECTURE => file.settings::<spherical::Settings>()?.notice.into_iter().collect(),
        points::ARCHITECTURE => file.settings::<PointSettings>()?.notice.into_iter().collect(),
        fused::ARCHITECTURE => {
            let [first, second] = fused::parts(file)?;
            let mut both = notices_of(&first)?;
            both.extend(notices_of(&second)?);
            both.dedup();
            both
        }
        _ => Vec::new(),
    };
    Ok(of_file)
}

/// Reads a model file.
///
/// # Errors
/// If the file is truncated, its architecture or version is unknown, a setting or tensor is invalid, or the
/// device of the options cannot be used.
pub fn load(path: &Path, options: &Options) -> Result<Box<dyn Segmenter>, SegmentationError> {
    let file = ModelFile::read(path)?;
    match file.card.architecture.as_str() {
        ground_quasi_flat::ARCHITECTURE => Ok(Box::new(GroundQuasiFlat::from_file(&file)?)),
        spherical::ARCHITECTURE => Ok(Box::new(SphericalModel::from_file(&file)?.with_options(*options)?)),
        points::ARCHITECTURE => Ok(Box::new(PointModel::from_file(&file)?.with_options(*options)?)),
        fused::ARCHITECTURE => Ok(Box::new(Fused::from_file(&file, options)?)),
        _ => Err(file.unknown_architecture()),
    }
}
