//! Files of a folder.

use anyhow::Context;
use std::path::{Path, PathBuf};

/// Files and folders in a folder, in the order of their names.
pub fn sorted_entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let about = || folder.display().to_string();
    let entries = std::fs::read_dir(folder).with_context(about)?;
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>().with_context(about)?;
    paths.sort();
    Ok(paths)
}
