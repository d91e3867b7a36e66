//! Records a file of another program.

use files::names::sort_by_name;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Result of recording a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Recorded {
    /// The file is in the recording now.
    New,
    /// The file was in the recording before.
    Before,
    /// The file has no content yet.
    Empty,
    /// The file was removed, or may not be read.
    Unreadable,
}

/// Records a complete file: by a hard link, which costs neither time nor space; on another file system by a copy. The
/// target is complete or absent, even after a crash. The error concerns the recording's file system.
pub(super) fn record_file(source: &Path, target: &Path) -> io::Result<Recorded> {
    let Ok(found) = fs::metadata(source) else { return Ok(Recorded::Unreadable) };
    if !found.is_file() || found.len() == 0 {
        return Ok(Recorded::Empty);
    }
    if let Ok(recorded) = fs::metadata(target) {
        let is_same_file = (recorded.dev(), recorded.ino()) == (found.dev(), found.ino());
        if is_same_file || recorded.len() == found.len() {
            return Ok(Recorded::Before);
        }
        // The earlier copy was taken too soon.
        return Ok(if copy(source, target)? { Recorded::Before } else { Recorded::Unreadable });
    }
    if fs::hard_link(source, target).is_ok() || copy(source, target)? {
        return Ok(Recorded::New);
    }
    Ok(Recorded::Unreadable)
}

/// Copies a file. `false` if the source cannot be read.
fn copy(source: &Path, target: &Path) -> io::Result<bool> {
    let Ok(mut from) = File::open(source) else { return Ok(false) };
    let partial =
        target.with_file_name(format!(".{}.partial", target.file_name().unwrap_or_default().to_string_lossy()));
    let mut to = File::create(&partial)?;
    io::copy(&mut from, &mut to)?;
    fs::rename(&partial, target)?;
    Ok(true)
}

/// Records the files of a folder and of `depth` levels of its subfolders that are not recorded yet. An absent folder
/// has no files.
pub(super) fn record_folder(source: &Path, target: &Path, depth: usize) -> io::Result<()> {
    let Ok(entries) = fs::read_dir(source) else { return Ok(()) };
    fs::create_dir_all(target)?;
    let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    sort_by_name(&mut paths);
    for (path, name) in paths.iter().filter_map(|path| Some((path, path.file_name()?))) {
        if path.is_file() {
            record_file(path, &target.join(name))?;
        } else if depth > 0 && path.is_dir() {
            record_folder(path, &target.join(name), depth - 1)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_recorded_once_and_copies_taken_too_early_are_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let source = folder.path().join("a");
        let target = folder.path().join("b");
        assert_eq!(record_file(&source, &target).expect("records"), Recorded::Unreadable);
        fs::write(&source, "").expect("writes");
        assert_eq!(record_file(&source, &target).expect("records"), Recorded::Empty);
        fs::write(&source, "image").expect("writes");
        assert_eq!(record_file(&source, &target).expect("records"), Recorded::New);
        assert_eq!(record_file(&source, &target).expect("records"), Recorded::Before);
        fs::remove_file(&target).expect("removes");
        fs::write(&target, "ima").expect("writes");
        assert_eq!(record_file(&source, &target).expect("records"), Recorded::Before);
        assert_eq!(fs::read(&target).expect("reads"), b"image");
        assert!(record_file(&source, &folder.path().join("nowhere/b")).is_err(), "the recording has no folder");
    }

    #[test]
    fn folder_is_recorded_with_its_subfolders() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("dark/2000000/deeper")).expect("makes");
        for name in ["dark/1.pgm", "dark/2000000/2.pgm", "dark/2000000/deeper/3.pgm"] {
            fs::write(at(name), name).expect("writes");
        }
        record_folder(&at("dark"), &at("recorded"), 1).expect("records");
        assert!(at("recorded/1.pgm").is_file() && at("recorded/2000000/2.pgm").is_file());
        assert!(!at("recorded/2000000/deeper").exists());
        record_folder(&at("absent"), &at("none"), 1).expect("an absent folder has no files");
        assert!(!at("none").exists());
    }
}
