//! Free space of file systems.

use rustix::fs::statvfs;
use std::path::Path;

/// Folder of POSIX shared memory on Linux.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Free shared memory that a run needs, bytes: two submaps of 4 million points of 28 bytes with their columns, one in work
/// and one waiting.
pub const MIN_SHARED_MEMORY: u64 = 512 << 20;

/// Bytes that this user may still write in a folder, or in the closest folder above it that exists. `None` if its file system
/// cannot be examined.
pub fn free_bytes(folder: impl AsRef<Path>) -> Option<u64> {
    let existing = folder.as_ref().ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    statvfs(existing).ok().map(|space| space.f_bavail * space.f_frsize)
}

/// Bytes of the files of a folder, without those of its folders; 0 if it cannot be listed.
pub fn bytes_of_files(folder: &Path) -> u64 {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| file.metadata().ok()).filter(std::fs::Metadata::is_file).map(|file| file.len()).sum()
}

/// A size for people: MB below 1 GB, else GB.
pub fn size_text(bytes: u64) -> String {
    if bytes < 1_000_000_000 {
        format!("{:.1} MB", bytes as f64 * 1e-6)
    } else {
        format!("{:.1} GB", bytes as f64 * 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_space_of_a_folder_to_be_made_is_that_of_the_folder_above() {
        let folder = tempfile::tempdir().expect("a folder");
        let free = |name: &str| free_bytes(folder.path().join(name)).expect("is examined");
        // Others write at the same time.
        assert!(free("a/b/c").abs_diff(free("")) < 1 << 30);
        assert!(free_bytes("/proc").is_some_and(|bytes| bytes == 0), "has no space");
    }

    #[test]
    fn files_of_a_folder_are_counted_without_folders() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("below")).expect("made");
        for (name, n) in [("a", 3), ("b", 5), ("below/c", 100)] {
            std::fs::write(folder.path().join(name), vec![0; n]).expect("written");
        }
        assert_eq!(bytes_of_files(folder.path()), 8);
        assert_eq!(bytes_of_files(&folder.path().join("absent")), 0);
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!((size_text(1_500_000).as_str(), size_text(2_340_000_000).as_str()), ("1.5 MB", "2.3 GB"));
    }
}
