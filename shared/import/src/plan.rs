//! The drive folder made by an import: links to the files of the source, and new files.

use crate::Kind;
use crate::error::{At, ImportError};
use drive::MANIFEST_FILE;
use drive::manifest::{Manifest, TruthEntry};
use formats::trajectory::tum_from_trajectory;
use geometry::Trajectory;
use std::fs;
use std::path::{Path, PathBuf};

/// Content of a drive folder, except for the files that are converted while the source is read.
pub(crate) struct Plan {
    pub kind: Kind,
    pub manifest: Manifest,
    pub links: Vec<Link>,
    pub texts: Vec<TextFile>,
    pub conversions: Vec<Conversion>,
    /// Files of the source that were read into the manifest or into texts.
    pub read: Vec<PathBuf>,
    /// Lines of the report: imported data and how it was interpreted.
    pub report: Vec<String>,
}

/// A link to a file of the source, with its path in the drive folder.
#[derive(Debug)]
pub(crate) struct Link {
    pub place: PathBuf,
    /// Absolute path of the file.
    pub original: PathBuf,
}

/// A file that the import writes.
#[derive(Debug)]
pub(crate) struct TextFile {
    pub place: PathBuf,
    pub text: String,
}

/// A file converted from files of the source, one at a time while the folder is written.
pub(crate) struct Conversion {
    pub place: PathBuf,
    /// The files of the source.
    pub originals: Vec<PathBuf>,
    pub bytes: Box<dyn Fn() -> Result<Vec<u8>, ImportError>>,
}

impl Plan {
    /// Adds the true trajectory, and the folder of the labels if there are any.
    pub fn add_truth(&mut self, trajectory: &Trajectory, labels: Option<&str>) {
        let place = "truth/trajectory.txt";
        self.texts.push(TextFile { place: place.into(), text: tum_from_trajectory(trajectory) });
        self.manifest.truth = Some(TruthEntry {
            trajectory: place.into(),
            labels: labels.map(str::to_owned),
            calibration: None,
            gnss: None,
        });
    }

    /// Writes the folder, which must exist and be empty.
    pub fn write(&self, out: &Path) -> Result<(), ImportError> {
        for link in &self.links {
            let path = in_folder(out, &link.place)?;
            std::os::unix::fs::symlink(&link.original, &path).at(&path)?;
        }
        for file in &self.texts {
            let path = in_folder(out, &file.place)?;
            fs::write(&path, &file.text).at(&path)?;
        }
        for conversion in &self.conversions {
            let path = in_folder(out, &conversion.place)?;
            fs::write(&path, (conversion.bytes)()?).at(&path)?;
        }
        let path = out.join(MANIFEST_FILE);
        let text = toml::to_string(&self.manifest).at(&path)?;
        fs::write(&path, text).at(&path)
    }
}

/// A path below the folder; creates its parent folder.
fn in_folder(out: &Path, place: &Path) -> Result<PathBuf, ImportError> {
    let path = out.join(place);
    let folder = path.parent().unwrap_or(out);
    fs::create_dir_all(folder).at(folder)?;
    Ok(path)
}
