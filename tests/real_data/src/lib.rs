//! Recordings made by others lie beside the project, in `../shared/data` or `$REPLICA_DATA`. Tests that read them are
//! skipped, by name, where they are absent.

use std::path::{Path, PathBuf};

/// The file or folder, or `None` after saying on stderr what is skipped.
pub fn real_data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("REPLICA_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: real data {name} is not in {}", folder.display());
    None
}
