//! Imports into folders of a test.

use drive::{Drive, NoLabel, Shot, TrueLabel};
use import::Options;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Source and destination of an import.
pub struct Import {
    pub source: PathBuf,
    pub out: PathBuf,
    pub options: Options,
}

impl Import {
    pub fn run(&self) -> Result<Vec<String>, import::ImportError> {
        import::import(&self.source, &self.out, &self.options)
    }
}

pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

pub fn write_file(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().expect("has one")).expect("makes");
    fs::write(path, bytes).expect("writes");
}

pub fn import_from(source: impl Into<PathBuf>, folder: &TempDir) -> Import {
    Import { source: source.into(), out: folder.path().join("drive"), options: Options::default() }
}

/// The header of a PNG image.
pub fn png(width: u32, height: u32) -> Vec<u8> {
    let begin = b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR";
    [&begin[..], &width.to_be_bytes(), &height.to_be_bytes(), &[8, 2, 0, 0, 0]].concat()
}

/// The true label of the first return of a sweep.
pub fn first_label(drive: &Drive, seq: usize) -> Result<TrueLabel, NoLabel> {
    let mut sweeps = drive.sweeps().expect("opens");
    let mut first = None;
    for _ in 0..=seq {
        let mut returns = Vec::new();
        let sweep = sweeps.next_sweep(|some| returns.extend_from_slice(some)).expect("reads").expect("has one");
        first = Some((sweep.stamp, returns[0]));
    }
    let (stamp, found) = first.expect("has one");
    let range_m = (found.x * found.x + found.y * found.y + found.z * found.z).sqrt();
    let shot = Shot { stamp: stamp.0, ring: found.ring, azimuth: Some(found.azimuth), range_m: Some(range_m) };
    drive.true_labels().expect("fits the returns").find(&shot)
}

/// Error of an import that fails and leaves nothing.
pub fn error(import: &Import) -> String {
    let error = import.run().expect_err("is refused");
    let names =
        import.out.parent().expect("has one").read_dir().expect("lists").map(|entry| entry.expect("lists").file_name());
    assert!(!names.into_iter().any(|name| name.to_string_lossy().starts_with("drive")), "nothing is written");
    error.to_string()
}
