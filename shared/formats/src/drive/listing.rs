//! Lists the files of a drive.

use geometry::Stamp;
use std::io;
use std::path::{Path, PathBuf};

/// Image file of one exposure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Middle of the exposure.
    pub stamp: Stamp,
    /// Index of the camera among the cameras of its kind.
    pub camera: usize,
    /// The file.
    pub path: PathBuf,
}

/// Files in a folder with one of the extensions (in any case), sorted by name. Hidden files are skipped.
pub(super) fn files_with_extension(folder: &Path, extensions: &[&str]) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in folder.read_dir()? {
        let path = entry?.path();
        let hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        // Links are followed: importers link instead of copying.
        if !hidden && extension.is_some_and(|extension| extensions.contains(&extension.as_str())) && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Exposures of one camera sorted by stamp, and files whose names are not stamps.
pub(super) fn frames(folder: &Path, camera: usize, extensions: &[&str]) -> io::Result<(Vec<Frame>, Vec<PathBuf>)> {
    let (mut frames, mut unnamed) = (Vec::new(), Vec::new());
    for path in files_with_extension(folder, extensions)? {
        let stamp = path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse().ok());
        match stamp {
            Some(nanos) => frames.push(Frame { stamp: Stamp(nanos), camera, path }),
            None => unnamed.push(path),
        }
    }
    frames.sort_by(|a, b| (a.stamp, &a.path).cmp(&(b.stamp, &b.path)));
    Ok((frames, unnamed))
}
