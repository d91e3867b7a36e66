//! Dark and white frames of the mosaic cameras. They are recorded when the run starts; later ones are only reported,
//! because the cubes of a run use the references of its start.

use crate::live::record_file::record_folder;
use files::names::sort_by_name;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{fs, io};

/// Folders next to the images of a mosaic camera.
const FOLDERS: [&str; 2] = ["dark", "white"];
/// Interval of the searches for later frames.
const INTERVAL: Duration = Duration::from_secs(10);

/// The references of all mosaic cameras.
#[derive(Debug, Default)]
pub(super) struct References {
    folders: Vec<Folder>,
    searched: Option<Instant>,
}

/// Frames of a camera.
#[derive(Debug)]
struct Folder {
    /// Name of the camera.
    camera: String,
    source: PathBuf,
    recorded: PathBuf,
    /// Frames that have been reported.
    n_added: u64,
}

/// Frames that were added during the run.
#[derive(Debug, Default, PartialEq)]
pub struct AddedReferences {
    /// Number of frames.
    pub n: u64,
    /// A note for the operator for each folder with its first ones.
    pub notes: Vec<String>,
}

impl References {
    /// Records the frames of a camera: the frames next to its images, else the frames of the rig.
    pub fn record(&mut self, camera: &str, images: &Path, of_rig: &Path, recorded: &Path) -> io::Result<()> {
        for name in FOLDERS {
            let beside_images = images.join(name);
            let found = [&beside_images, &of_rig.join(name)].into_iter().find(|folder| folder.is_dir()).cloned();
            let recorded = recorded.join(name);
            if let Some(folder) = &found {
                record_folder(folder, &recorded, 1)?;
            }
            let source = found.unwrap_or(beside_images);
            self.folders.push(Folder { camera: camera.to_owned(), source, recorded, n_added: 0 });
        }
        Ok(())
    }

    /// The frames that were added since the last search. Searches every ten seconds, or at the end.
    pub fn added(&mut self, is_end: bool) -> AddedReferences {
        if !is_end && self.searched.is_some_and(|searched| searched.elapsed() < INTERVAL) {
            return AddedReferences::default();
        }
        self.searched = Some(Instant::now());
        let mut n_added = 0;
        let mut notes = Vec::new();
        for folder in &mut self.folders {
            let later = later_files(&folder.source, &folder.recorded, 1);
            n_added += (later.len() as u64).saturating_sub(folder.n_added);
            if let Some(path) = later.first().filter(|_| folder.n_added == 0) {
                notes.push(format!(
                    "mosaic {}: {} was added during the run and is not used: dark and white frames are read when the run starts; restart it",
                    folder.camera,
                    path.display()
                ));
            }
            folder.n_added = folder.n_added.max(later.len() as u64);
        }
        AddedReferences { n: n_added, notes }
    }
}

/// Files that are not recorded, `depth` levels of folders deep, in the order of their names.
fn later_files(source: &Path, recorded: &Path, depth: usize) -> Vec<PathBuf> {
    let entries = fs::read_dir(source).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    sort_by_name(&mut paths);
    let mut later = Vec::new();
    for (path, name) in paths.iter().filter_map(|path| Some((path, path.file_name()?))) {
        let target = recorded.join(name);
        if path.is_dir() && depth > 0 {
            later.extend(later_files(path, &target, depth - 1));
        } else if path.is_file() && !target.exists() {
            later.push(path.clone());
        }
    }
    later
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_start_are_recorded_and_later_ones_reported_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["grabber/hs03/dark", "grabber/hs03/dark/2000000", "rig/hs03/dark", "rig/hs03/white"] {
            fs::create_dir_all(at(name)).expect("makes");
        }
        for name in ["grabber/hs03/dark/1.pgm", "rig/hs03/dark/2.pgm", "rig/hs03/white/3.pgm"] {
            fs::write(at(name), "frame").expect("writes");
        }
        let mut references = References::default();
        let recorded = at("recording/hs03");
        references.record("hs03", &at("grabber/hs03"), &at("rig/hs03"), &recorded).expect("records");
        assert!(recorded.join("dark/1.pgm").is_file() && recorded.join("white/3.pgm").is_file());
        assert!(!recorded.join("dark/2.pgm").exists(), "frames next to the images take precedence");
        assert_eq!(references.added(false), AddedReferences::default());
        fs::write(at("grabber/hs03/dark/2000000/4.pgm"), "frame").expect("writes");
        assert_eq!(references.added(false), AddedReferences::default(), "not yet again");
        let AddedReferences { n, notes } = references.added(true);
        assert_eq!((n, notes.len()), (1, 1));
        assert!(notes[0].contains("mosaic hs03: ") && notes[0].contains("dark/2000000/4.pgm was added"), "{notes:?}");
        fs::write(at("grabber/hs03/dark/5.pgm"), "frame").expect("writes");
        let later = references.added(true);
        assert_eq!(later, AddedReferences { n: 1, notes: Vec::new() }, "one line for each folder");
        assert!(!recorded.join("dark/5.pgm").exists());
    }
}
