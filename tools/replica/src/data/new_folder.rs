//! A folder that a command fills: empty before, complete after. A command that fails or is killed leaves no file that
//! could be mistaken for a result, and the same command starts again.
//!
//! The command writes into the folder `.unfinished` in it, whose entries are moved at the end. The file `moved` in
//! there names them, so that the next command can remove the entries that a killed one has already moved.

use anyhow::{Context, ensure};
use command_line::usage_error::UsageError;
use files::regular_file;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Holds the files until the command has finished.
const UNFINISHED: &str = ".unfinished";
/// File in `.unfinished` that the command locks.
const LOCK: &str = "lock";
/// File in `.unfinished` with the names of the entries that are being moved, one per line.
const MOVED: &str = "moved";
/// Folder in `.unfinished` with the files.
const FILES: &str = "files";

/// The folder, locked for this command.
pub struct NewFolder {
    out: PathBuf,
    /// Where the command writes.
    pub files: PathBuf,
    _lock: File,
}

impl NewFolder {
    /// Creates the folder, which must be empty: files of an earlier command would be mistaken for files of this one. What
    /// a killed command has left is removed.
    pub fn create(out: &Path) -> anyhow::Result<Self> {
        let unfinished = out.join(UNFINISHED);
        let lock = if unfinished.exists() {
            let lock = lock(&unfinished)?;
            remove_leftovers(out)?;
            Some(lock)
        } else {
            None
        };
        let place = || out.display().to_string();
        let is_left_out = |name: &std::ffi::OsStr| name == UNFINISHED;
        std::fs::create_dir_all(out).with_context(place)?;
        let mut entries = std::fs::read_dir(out).with_context(place)?;
        let is_empty = entries.all(|entry| entry.is_ok_and(|entry| is_left_out(&entry.file_name())));
        ensure!(is_empty, UsageError(format!("--out {}: the folder must be empty", place())));
        let files = unfinished.join(FILES);
        std::fs::create_dir_all(&files).with_context(place)?;
        let lock = lock.map_or_else(|| self::lock(&unfinished), Ok)?;
        Ok(Self { out: out.to_owned(), files, _lock: lock })
    }

    /// Moves all files to their place.
    pub fn finish(self) -> anyhow::Result<()> {
        let place = || self.out.display().to_string();
        let entries = std::fs::read_dir(&self.files).with_context(place)?;
        let names = entries.map(|entry| Ok(entry?.file_name().into_string().unwrap_or_default()));
        let names: Vec<String> = names.collect::<std::io::Result<_>>().with_context(place)?;
        let moved = self.out.join(UNFINISHED).join(MOVED);
        std::fs::write(&moved, names.join("\n")).with_context(place)?;
        for name in &names {
            std::fs::rename(self.files.join(name), self.out.join(name)).with_context(place)?;
        }
        // Its drop removes the rest.
        Ok(())
    }
}

impl Drop for NewFolder {
    fn drop(&mut self) {
        // After a failure, the next command removes what cannot be removed now.
        let _ = std::fs::remove_dir_all(self.out.join(UNFINISHED));
    }
}

/// Refuses a folder into which another command is writing.
fn lock(unfinished: &Path) -> anyhow::Result<File> {
    let path = unfinished.join(LOCK);
    let file = File::create(&path).with_context(|| path.display().to_string())?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            Err(UsageError(format!("{}: another command is writing here", unfinished.display())).into())
        }
        Err(TryLockError::Error(error)) => Err(error).with_context(|| path.display().to_string()),
    }
}

/// Removes the files of a killed command, the moved ones too.
fn remove_leftovers(out: &Path) -> anyhow::Result<()> {
    let unfinished = out.join(UNFINISHED);
    let moved = regular_file::read_to_string(unfinished.join(MOVED)).unwrap_or_default();
    // Only plain names, whatever the file contains.
    let names = moved.lines().filter(|name| Path::new(name).components().count() == 1 && *name != "..");
    for path in names.map(|name| out.join(name)).chain([unfinished.join(FILES), unfinished.join(MOVED)]) {
        let removed = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        match removed {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| path.display().to_string());
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("text")).collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_at_the_end_and_a_failure_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("a/b");
        let new = NewFolder::create(&out).expect("created");
        std::fs::write(new.files.join("tile.laz"), "points").expect("written");
        assert_eq!(names(&out), [UNFINISHED]);
        let error = NewFolder::create(&out).err().expect("locked");
        assert!(error.to_string().ends_with("another command is writing here"), "{error}");
        drop(new);
        assert_eq!(names(&out), [""; 0]);
        let new = NewFolder::create(&out).expect("created");
        std::fs::create_dir(new.files.join("tiles")).expect("made");
        std::fs::write(new.files.join("tiles/1.laz"), "points").expect("written");
        new.finish().expect("finished");
        assert_eq!(names(&out), ["tiles"]);
        let error = NewFolder::create(&out).err().expect("not empty");
        assert!(error.to_string().ends_with("the folder must be empty"), "{error}");
    }

    #[test]
    fn leftovers_of_a_killed_command_are_removed_and_foreign_files_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out");
        let outside = folder.path().join("outside");
        std::fs::write(&outside, "kept").expect("written");
        let killed = || {
            std::fs::create_dir_all(out.join(UNFINISHED).join(FILES)).expect("made");
            std::fs::write(out.join(UNFINISHED).join(FILES).join("path.csv"), "half").expect("written");
            std::fs::create_dir_all(out.join("tiles")).expect("made");
            std::fs::write(out.join(UNFINISHED).join(MOVED), "tiles\npath.csv\n../outside\n..\n").expect("written");
        };
        killed();
        let new = NewFolder::create(&out).expect("created");
        assert_eq!((names(&out), names(&new.files)), (vec![UNFINISHED.to_owned()], vec![]));
        drop(new);
        killed();
        std::fs::write(out.join("notes.txt"), "of the user").expect("written");
        let error = NewFolder::create(&out).err().expect("not empty");
        assert!(error.to_string().ends_with("the folder must be empty"), "{error}");
        assert!(out.join("notes.txt").exists() && outside.exists());
    }
}
