//! Files of a source.

use crate::error::{At, ImportError};
use files::names::natural_order;
use std::path::{Path, PathBuf};

/// Names and absolute paths of the files of a folder with this ending (in any letter case), in natural order of their names.
/// Empty for a file.
pub(crate) fn files(folder: &Path, end: &str) -> Result<Vec<(String, PathBuf)>, ImportError> {
    let mut files = Vec::new();
    if !folder.is_dir() {
        return Ok(files);
    }
    for entry in folder.read_dir().at(folder)? {
        let path = entry.at(folder)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if stem(&name, end).is_some() && !name.starts_with('.') && path.is_file() {
            let absolute = path.canonicalize().at(&path)?;
            files.push((name, absolute));
        }
    }
    files.sort_by(|a: &(String, PathBuf), b| natural_order(&a.0, &b.0));
    Ok(files)
}

/// A name without its ending, in any letter case.
pub(crate) fn stem<'a>(name: &'a str, end: &str) -> Option<&'a str> {
    let at = name.len().checked_sub(end.len())?;
    let is_end = name.get(at..).is_some_and(|found| found.eq_ignore_ascii_case(end));
    if is_end { name.get(..at) } else { None }
}

/// Ending of the images in a folder: of the first of these with files.
pub(crate) fn image_end(folder: &Path) -> Result<Option<&'static str>, ImportError> {
    for end in [".png", ".jpg", ".jpeg"] {
        if !files(folder, end)?.is_empty() {
            return Ok(Some(end));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_are_found_in_any_letter_case() {
        assert_eq!(stem("000001.PLY", ".ply"), Some("000001"));
        assert_eq!(stem("a.pcd.BIN", ".pcd.bin"), Some("a"));
        for name in ["ply", "a.plyx", "ä"] {
            assert_eq!(stem(name, ".ply"), None, "{name}");
        }
    }
}
