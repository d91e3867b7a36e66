//! Files of a target, for readers of paths.

use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Memory, if the system has such a folder: a file on a disk takes longer than most readers.
const MEMORY: &str = "/dev/shm";

fn folder() -> TempDir {
    let in_memory = tempfile::Builder::new().prefix("fuzz_targets_").tempdir_in(MEMORY);
    in_memory.or_else(|_| tempfile::tempdir()).expect("a folder")
}

thread_local!(static FOLDER: TempDir = folder());

/// Calls `read` with a file of this name and these bytes.
pub(crate) fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    with_files(&[(name, bytes)], |folder| read(&folder.join(name)));
}

/// Calls `read` with a folder of these files. Their names may have folders.
pub(crate) fn with_files(files: &[(&str, &[u8])], read: impl FnOnce(&Path)) {
    FOLDER.with(|folder| {
        let folder = folder.path().join("input");
        fs::create_dir(&folder).expect("makes a folder");
        for (name, bytes) in files {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().expect("is in a folder")).expect("makes a folder");
            fs::write(&path, bytes).expect("writes");
        }
        read(&folder);
        fs::remove_dir_all(&folder).expect("removes");
    });
}

/// The parts of an input for several files, which are separated by a byte 0. Missing parts are empty.
pub(crate) fn parts<const N: usize>(bytes: &[u8]) -> [&[u8]; N] {
    let mut parts = bytes.splitn(N, |byte| *byte == 0);
    std::array::from_fn(|_| parts.next().unwrap_or_default())
}
