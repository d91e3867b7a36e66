//! Models of color lines from files, one for each camera.

use crate::Settings;
use crate::references::{CubeCamera, CubeCameraError};
use color_lines::{ColorLinesError, CubeRegions, Model};
use formats::text_file::{TextFileError, read_text};
use std::path::{Path, PathBuf};

/// Why the model files cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    #[error("{}: {source}", .path.display())]
    Read { path: PathBuf, source: TextFileError },
    #[error("{}: {source}", .path.display())]
    Model { path: PathBuf, source: ColorLinesError },
    #[error("color_lines_models needs color_lines = \"regions\" or \"simplified\"")]
    Off,
    #[error("color_lines_models names {found} files; the stage has {expected} mosaic cameras, and each needs one")]
    Count { found: usize, expected: usize },
    #[error(
        "{}: the model has {found} bands; the cubes of mosaic camera {camera} have {expected}: make the model of its cubes",
        .path.display()
    )]
    Bands { path: PathBuf, camera: usize, found: usize, expected: usize },
}

/// Largest model file, bytes. One of 4096 regions of 25 bands has about 4 MB.
const MAX_BYTES: u64 = 64 << 20;

/// The models that the settings name, with their files.
pub fn read_models(settings: &Settings, launch_folder: &Path) -> Result<Vec<(PathBuf, Model)>, ModelsError> {
    if !settings.color_lines_models.is_empty() && settings.color_lines == "off" {
        return Err(ModelsError::Off);
    }
    let read = |name: &String| {
        let path = launch_folder.join(name);
        let text = read_text(&path, MAX_BYTES).map_err(|source| ModelsError::Read { path: path.clone(), source })?;
        let model = Model::from_json(&text).map_err(|source| ModelsError::Model { path: path.clone(), source })?;
        Ok((path, model))
    };
    settings.color_lines_models.iter().map(read).collect()
}

/// The models of the cameras of the stage; none if no files are named. A camera that gives no cubes needs its file, too.
pub fn of_cameras(
    models: Vec<(PathBuf, Model)>,
    cameras: &[Option<Result<CubeCamera, CubeCameraError>>],
) -> Result<CubeRegions, ModelsError> {
    let own: Vec<(usize, &Result<CubeCamera, CubeCameraError>)> =
        cameras.iter().enumerate().filter_map(|(index, camera)| Some((index, camera.as_ref()?))).collect();
    let (found, expected) = (models.len(), own.len());
    if found != 0 && found != expected {
        return Err(ModelsError::Count { found, expected });
    }
    for ((path, model), (camera, cubes)) in models.iter().zip(&own) {
        let (camera, found) = (*camera, model.n_bands());
        let expected = cubes.as_ref().map_or(found, |cubes| cubes.spectral.valid_bands().count_ones() as usize);
        if found != expected {
            return Err(ModelsError::Bands { path: path.clone(), camera, found, expected });
        }
    }
    let models = own.iter().zip(models).map(|((camera, _), (_, model))| (*camera as u32, model));
    Ok(CubeRegions::of_models(models))
}
