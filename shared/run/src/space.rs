//! Free space of file systems.

use rustix::fs::statvfs;
use std::path::Path;

/// Folder of POSIX shared memory on Linux.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Free shared memory that a run needs, bytes: two submaps of 4 million points of 28 bytes with their columns, one
/// being processed and one waiting.
pub const MIN_SHARED_MEMORY: u64 = 512 << 20;

/// Bytes that this user may still write in a folder, or in its closest existing parent folder. `None` if its file
/// system cannot be examined.
pub fn free_bytes(folder: impl AsRef<Path>) -> Option<u64> {
    let existing = folder.as_ref().ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    statvfs(existing).ok().map(|space| space.f_bavail * space.f_frsize)
}

/// Bytes of the files directly in a folder, without its subfolders; 0 if it cannot be listed.
pub fn bytes_of_files(folder: &Path) -> u64 {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| file.metadata().ok()).filter(std::fs::Metadata::is_file).map(|file| file.len()).sum()
}

/// A size with a unit.
pub fn size_text(n: u64) -> String {
    match n {
        0..1_000 => format!("{n} B"),
        1_000..1_000_000 => format!("{:.1} kB", n as f64 * 1e-3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", n as f64 * 1e-6),
        _ => format!("{:.2} GB", n as f64 * 1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_space_of_a_folder_to_be_made_is_that_of_the_folder_above() {
        let folder = tempfile::tempdir().expect("a folder");
        let free = |name: &str| free_bytes(folder.path().join(name)).expect("is examined");
        // Other processes write at the same time.
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
        let texts = [999, 1_500, 1_500_000, 2_340_000_000].map(size_text);
        assert_eq!(texts, ["999 B", "1.5 kB", "1.5 MB", "2.34 GB"]);
    }
}
