//! Files of a target, for readers of paths.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder in memory, if the system has one: a file on a disk takes longer than most readers.
const MEMORY: &str = "/dev/shm";

/// The folder of the inputs, and its files. Each input overwrites the files of the last one: creating and removing them
/// for each input takes longer than most readers.
struct Scratch {
    folder: TempDir,
    names: Vec<String>,
}

impl Scratch {
    fn new() -> Self {
        let in_memory = tempfile::Builder::new().prefix("fuzz_targets_").tempdir_in(MEMORY);
        Self { folder: in_memory.or_else(|_| tempfile::tempdir()).expect("a folder"), names: Vec::new() }
    }

    /// Writes the files of an input.
    fn write(&mut self, files: &[(&str, &[u8])]) -> PathBuf {
        let folder = self.folder.path().join("input");
        if !self.names.iter().map(String::as_str).eq(files.iter().map(|(name, _)| *name)) || files.is_empty() {
            let _absent_at_first = fs::remove_dir_all(&folder);
            fs::create_dir(&folder).expect("makes a folder");
            for (name, _) in files {
                let path = folder.join(name);
                fs::create_dir_all(path.parent().expect("is in a folder")).expect("makes a folder");
            }
            self.names = files.iter().map(|(name, _)| (*name).to_owned()).collect();
        }
        for (name, bytes) in files {
            fs::write(folder.join(name), bytes).expect("writes");
        }
        folder
    }
}

thread_local!(static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::new()));

/// Calls `read` with a file of this name and these bytes.
pub(crate) fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    with_files(&[(name, bytes)], |folder| read(&folder.join(name)));
}

/// Calls `read` with a folder of these files. Their names may have folders. `read` must remove all files that it adds.
pub(crate) fn with_files(files: &[(&str, &[u8])], read: impl FnOnce(&Path)) {
    let folder = SCRATCH.with_borrow_mut(|scratch| scratch.write(files));
    read(&folder);
}

/// The parts of an input for several files, which are separated by a byte 0. Missing parts are empty.
pub(crate) fn parts<const N: usize>(bytes: &[u8]) -> [&[u8]; N] {
    let mut parts = bytes.splitn(N, |byte| *byte == 0);
    std::array::from_fn(|_| parts.next().unwrap_or_default())
}
