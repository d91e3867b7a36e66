//! The drive folder made by an import: links to the files of the source, and new files.

use crate::Kind;
use crate::error::{At, ImportError};
use drive::MANIFEST_FILE;
use drive::manifest::{Manifest, TruthEntry};
use formats::cloud_fields::PointFlags;
use formats::trajectory::tum_from_trajectory;
use geometry::Trajectory;
use std::fs;
use std::io::{self, ErrorKind};
use std::os::unix::fs::symlink;
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
    pub content: Box<dyn Fn() -> Result<Converted, ImportError>>,
}

/// The content of a converted file.
pub(crate) struct Converted {
    pub bytes: Vec<u8>,
    /// Flagged points of the originals.
    pub flags: PointFlags,
}

impl From<Vec<u8>> for Converted {
    /// Originals without flags.
    fn from(bytes: Vec<u8>) -> Self {
        Self { bytes, flags: PointFlags::default() }
    }
}

/// What happened while a folder was written.
#[derive(Default)]
pub(crate) struct Written {
    /// Files that were copied, because their file system has no links.
    pub n_copied: usize,
    /// Flagged points of all converted files.
    pub flags: PointFlags,
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
    pub fn write(&self, out: &Path) -> Result<Written, ImportError> {
        let mut written = Written::default();
        for link in &self.links {
            let path = in_folder(out, &link.place)?;
            written.n_copied +=
                usize::from(link_or_copy(&link.original, &path, |original, path| symlink(original, path)).at(&path)?);
        }
        for file in &self.texts {
            let path = in_folder(out, &file.place)?;
            fs::write(&path, &file.text).at(&path)?;
        }
        for conversion in &self.conversions {
            let path = in_folder(out, &conversion.place)?;
            let Converted { bytes, flags } = (conversion.content)()?;
            written.flags = written.flags.plus(flags);
            fs::write(&path, bytes).at(&path)?;
        }
        let path = out.join(MANIFEST_FILE);
        let text = toml::to_string(&self.manifest).at(&path)?;
        fs::write(&path, text).at(&path)?;
        Ok(written)
    }
}

/// Links a file by `link`. Copies it where the file system (exFAT, FAT, most network shares) refuses links. Returns whether
/// it was copied.
fn link_or_copy(original: &Path, path: &Path, link: impl Fn(&Path, &Path) -> io::Result<()>) -> io::Result<bool> {
    match link(original, path) {
        Ok(()) => Ok(false),
        Err(error) if matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::Unsupported) => {
            fs::copy(original, path).map(|_| true)
        }
        Err(error) => Err(error),
    }
}

/// A path below the folder; creates its parent folder.
fn in_folder(out: &Path, place: &Path) -> Result<PathBuf, ImportError> {
    let path = out.join(place);
    let folder = path.parent().unwrap_or(out);
    fs::create_dir_all(folder).at(folder)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_copied_where_the_file_system_refuses_links() {
        let folder = tempfile::tempdir().expect("a folder");
        let original = folder.path().join("a.pcd");
        fs::write(&original, "points").expect("written");
        let to = |name: &str| folder.path().join(name);
        assert!(!link_or_copy(&original, &to("linked"), |a, b| symlink(a, b)).expect("linked"));
        // EPERM of Linux, and EOPNOTSUPP.
        for code in [1, 95] {
            let copy = to(&format!("copied_{code}"));
            let refuse = |_: &Path, _: &Path| Err(io::Error::from_raw_os_error(code));
            assert!(link_or_copy(&original, &copy, refuse).expect("copied"));
            assert!(copy.symlink_metadata().expect("a file").is_file());
            assert_eq!(fs::read(&copy).expect("readable"), b"points");
        }
        let full = |_: &Path, _: &Path| Err(io::Error::from_raw_os_error(28));
        assert!(link_or_copy(&original, &to("full"), full).is_err());
    }
}
