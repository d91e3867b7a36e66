//! Parses `drive.toml`.

use crate::manifest::Manifest;
use crate::problems::FileError;
use crate::toml_file::TomlFile;
use std::path::Path;

/// A manifest with the problems found so far. The manifest is present if all entries could be read.
pub(super) struct Read {
    pub(super) file: TomlFile,
    pub(super) manifest: Option<Manifest>,
}

const KEYS: [&str; 8] = ["version", "name", "lidar", "camera", "mosaic", "gnss", "imu", "truth"];

impl Read {
    /// A manifest that was inferred, not read.
    pub(super) fn inferred(path: &Path, manifest: Manifest) -> Self {
        Self { file: TomlFile::new(path, "", &KEYS), manifest: Some(manifest) }
    }

    pub(super) fn of_text(path: &Path, text: String) -> Self {
        let mut file = TomlFile::new(path, text, &KEYS);
        let (version, name, lidar) = (file.required("version"), file.required("name"), file.required("lidar"));
        let (cameras, mosaics) = (file.list("camera"), file.list("mosaic"));
        let (gnss, imu, truth) = (file.optional("gnss"), file.optional("imu"), file.optional("truth"));
        let valid = version.zip(name).zip(lidar).filter(|_| file.is_sound());
        let manifest =
            valid.map(|((version, name), lidar)| Manifest { version, name, lidar, cameras, mosaics, gnss, imu, truth });
        Self { file, manifest }
    }

    /// The manifest and the file for reporting further problems, or all problems found so far.
    pub(super) fn valid(self) -> Result<(Manifest, TomlFile), FileError> {
        let Self { file, manifest } = self;
        match manifest {
            Some(manifest) => Ok((manifest, file)),
            None => Err(file.into_error()),
        }
    }
}
