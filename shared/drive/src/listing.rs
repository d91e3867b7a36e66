//! Lists the files of a drive.

use files::names::sort_by_name;
use geometry::Stamp;
use lidar::pcap::{Compression, is_capture_name};
use std::io;
use std::path::{Path, PathBuf};

/// Extensions of color images.
pub(super) const IMAGES: &[&str] = &["jpg", "jpeg", "png"];
/// Extensions of mosaics.
pub(super) const MOSAICS: &[&str] = &["pgm"];

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

impl Frame {
    /// The exposure with the delay of its stamp subtracted.
    pub(super) fn without_delay(self, delay_nanos: i64) -> Self {
        Self { stamp: self.stamp.plus_nanos(delay_nanos.saturating_neg()), ..self }
    }
}

/// Whether a file is an exposure of a color camera by its name: not hidden, extension `jpg`, `jpeg` or `png`.
pub fn is_image_name(path: &Path) -> bool {
    has_extension(path, IMAGES)
}

/// Whether a file is an exposure of a mosaic camera by its name: not hidden, extension `pgm`.
pub fn is_mosaic_name(path: &Path) -> bool {
    has_extension(path, MOSAICS)
}

/// Stamp in the name of an exposure.
pub fn frame_stamp(path: &Path) -> Option<Stamp> {
    path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse().ok()).map(Stamp)
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    !hidden && extension.is_some_and(|extension| extensions.contains(&extension.as_str()))
}

/// Captures in a folder, sorted by name. Hidden files are skipped. Fails if a capture is only there compressed.
pub(super) fn captures(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let is_compressed = |path: &Path| Compression::find(path).is_some() && !path.with_extension("").exists();
    if let Some(path) = files_with_name(folder, is_compressed)?.first()
        && let Some(compression) = Compression::find(path)
    {
        return Err(io::Error::other(format!("{} {compression}", path.display())));
    }
    files_with_name(folder, is_capture_name)
}

/// Files in a folder with one of the extensions (in any case), sorted by name. Hidden files are skipped.
pub(super) fn files_with_extension(folder: &Path, extensions: &[&str]) -> io::Result<Vec<PathBuf>> {
    files_with_name(folder, |path| has_extension(path, extensions))
}

/// Files in a folder, sorted by name in natural order: `2.pcd` comes before `10.pcd`.
pub(super) fn files_with_name(folder: &Path, is_one: impl Fn(&Path) -> bool) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in folder.read_dir()? {
        let path = entry?.path();
        // Links are followed: importers link instead of copying.
        if is_one(&path) && path.is_file() {
            files.push(path);
        }
    }
    sort_by_name(&mut files);
    Ok(files)
}

/// Images of one camera.
#[derive(Default)]
pub(super) struct ListedFrames {
    /// Exposures sorted by stamp.
    pub(super) frames: Vec<Frame>,
    /// Files whose names are not stamps.
    pub(super) unnamed: Vec<PathBuf>,
}

pub(super) fn frames(folder: &Path, camera: usize, extensions: &[&str]) -> io::Result<ListedFrames> {
    let mut frames = Vec::new();
    let mut unnamed = Vec::new();
    for path in files_with_extension(folder, extensions)? {
        match frame_stamp(&path) {
            Some(stamp) => frames.push(Frame { stamp, camera, path }),
            None => unnamed.push(path),
        }
    }
    frames.sort_by(|a, b| (a.stamp, &a.path).cmp(&(b.stamp, &b.path)));
    Ok(ListedFrames { frames, unnamed })
}
