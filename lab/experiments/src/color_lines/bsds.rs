//! Images of BSDS500 with their manual segmentations.

use super::ColorImage;
use super::mat_file::{Segmentation, segmentations};
use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};

/// An image and its segmentations.
pub struct Example {
    pub image: ColorImage,
    pub segmentations: Vec<Segmentation>,
}

/// The training images of a folder that has `images/train` and `groundTruth/train`, by name.
pub fn training_images(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let images = folder.join("images/train");
    let entries = std::fs::read_dir(&images).with_context(|| images.display().to_string())?;
    let mut paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>()?;
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "jpg"));
    paths.sort();
    Ok(paths)
}

impl Example {
    /// Reads an image and its segmentations.
    pub fn read(folder: &Path, path: &Path) -> anyhow::Result<Self> {
        let name = path.file_stem().unwrap_or_default();
        let truth = folder.join("groundTruth/train").join(name).with_extension("mat");
        let about = || truth.display().to_string();
        let image = ColorImage::read(path)?;
        let segmentations = segmentations(&std::fs::read(&truth).with_context(about)?).with_context(about)?;
        ensure!(!segmentations.is_empty(), "{}: no segmentation", about());
        for Segmentation { size, .. } in &segmentations {
            ensure!(*size == image.size, "{}: segmentation of {size:?} px, image of {:?}", about(), image.size);
        }
        Ok(Self { image, segmentations })
    }
}
