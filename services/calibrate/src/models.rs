//! Models of color lines from files, one for each camera.

use crate::references::{CubeCamera, CubeCameraError};
use crate::{ColorLines, Settings};
use color_lines::{ColorLinesError, CubeRegions, Model};
use files::text_file::{TextFileError, read_text};
use std::path::{Path, PathBuf};

/// Model files that cannot be used.
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
    Bands { path: PathBuf, camera: u32, found: usize, expected: usize },
}

/// Largest model file, bytes. One of 4096 regions of 25 bands has about 4 MB.
const MAX_BYTES: u64 = 64 << 20;

/// The models that the settings name, by camera; empty if they name no models. A camera that gives no cubes also needs
/// its file.
pub fn read_models(
    settings: &Settings,
    launch_folder: &Path,
    cameras: &[Option<Result<CubeCamera, CubeCameraError>>],
) -> Result<CubeRegions, ModelsError> {
    let names = &settings.color_lines_models;
    if names.is_empty() {
        return Ok(CubeRegions::default());
    }
    if settings.color_lines == ColorLines::Off {
        return Err(ModelsError::Off);
    }
    let own: Vec<_> = (0..).zip(cameras).filter_map(|(index, camera)| Some((index, camera.as_ref()?))).collect();
    if names.len() != own.len() {
        return Err(ModelsError::Count { found: names.len(), expected: own.len() });
    }
    let read = |(name, (camera, cubes)): (&String, (u32, &Result<CubeCamera, CubeCameraError>))| {
        let path = launch_folder.join(name);
        let text = read_text(&path, MAX_BYTES).map_err(|source| ModelsError::Read { path: path.clone(), source })?;
        let model = Model::from_json(&text).map_err(|source| ModelsError::Model { path: path.clone(), source })?;
        let found = model.n_bands();
        let expected = cubes.as_ref().map_or(found, |cubes| cubes.spectral.valid_bands().count_ones() as usize);
        if found == expected { Ok((camera, model)) } else { Err(ModelsError::Bands { path, camera, found, expected }) }
    };
    let models = names.iter().zip(own).map(read).collect::<Result<Vec<_>, _>>()?;
    Ok(CubeRegions::from_models(models))
}
