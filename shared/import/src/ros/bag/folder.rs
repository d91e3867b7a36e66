//! ROS 2 bags that are folders: `metadata.yaml` and one file or more.

use crate::error::{At, ImportError};
use std::path::{Path, PathBuf};

/// Describes the files of a ROS 2 bag.
pub(crate) const METADATA: &str = "metadata.yaml";
/// Longest description, bytes. A bag of a thousand files has a tenth of it.
const MAX_METADATA: u64 = 1 << 24;

pub(super) fn is_bag(folder: &Path) -> bool {
    let has_title = |text: String| text.starts_with("rosbag2_bagfile_information:");
    std::fs::read_to_string(folder.join(METADATA)).is_ok_and(has_title)
}

/// The files of a bag in the order of their recording.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let path = folder.join(METADATA);
    if path.metadata().at(&path)?.len() > MAX_METADATA {
        return Err(ImportError::at(&path, format!("has more than {MAX_METADATA} bytes")));
    }
    let text = std::fs::read_to_string(&path).at(&path)?;
    let mode = value(&text, "compression_mode:");
    if let Some(mode) = mode.filter(|mode| !matches!(*mode, "" | "NONE" | "none")) {
        let rule = format!(
            "compression_mode {mode}: files or messages are compressed outside of their container; convert the bag: \
             `ros2 bag convert -i {} -o out.yaml` with compression_mode \"\"",
            folder.display()
        );
        return Err(ImportError::at(&path, rule));
    }
    let files = file_names(&text).map(|name| folder.join(name)).collect::<Vec<_>>();
    if files.is_empty() {
        return Err(ImportError::at(&path, "names no files under relative_file_paths"));
    }
    Ok(files)
}

/// The value behind a key, on any level.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines().find_map(|line| line.trim().strip_prefix(key)).map(unquoted)
}

fn unquoted(text: &str) -> &str {
    text.trim().trim_matches(['"', '\''])
}

/// The list behind `relative_file_paths`.
fn file_names(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().skip_while(|line| line.trim() != "relative_file_paths:").skip(1);
    lines.map_while(|line| line.trim().strip_prefix("- ")).map(unquoted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_compression_of_metadata_are_read() {
        let text = "rosbag2_bagfile_information:\n  compression_format: \"\"\n  compression_mode: \"FILE\"\n  \
                    relative_file_paths:\n    - a_0.db3\n    - \"a_1.db3\"\n  files:\n    - path: a_0.db3\n";
        assert_eq!(file_names(text).collect::<Vec<_>>(), ["a_0.db3", "a_1.db3"]);
        assert_eq!(value(text, "compression_mode:"), Some("FILE"));
        assert_eq!(value(text, "compression_format:"), Some(""));
    }
}
