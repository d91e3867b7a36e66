//! Bags that are folders: ROS 2 with `metadata.yaml` and one file or more, and split recordings of ROS 1.

use super::Kind;
use super::decompress::decompressed as stream;
use crate::error::{At, ImportError};
use crate::files::files as files_of;
use files::regular_file;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Component, Path, PathBuf};

/// File that describes the files of a ROS 2 bag.
pub(crate) const METADATA: &str = "metadata.yaml";
/// Longest description, bytes. A bag of a thousand files has a tenth of it.
const MAX_METADATA: u64 = 1 << 24;

/// Extension of compressed files.
const ZSTD: &str = "zstd";
/// Maximum number of bytes of a file per compressed byte. Real recordings have up to 20.
const MAX_RATIO: u64 = 256;

/// The files of a folder.
pub(super) struct FolderFiles {
    pub files: Vec<PathBuf>,
    /// Whether each message is compressed.
    pub is_zstd: bool,
    /// Whether the files are in the order of their recording.
    pub in_order: bool,
}

pub(super) fn is_bag(folder: &Path) -> bool {
    let has_title = |text: String| text.starts_with("rosbag2_bagfile_information:");
    regular_file::read_to_string(folder.join(METADATA)).is_ok_and(has_title) || !ros1_files(folder).is_empty()
}

/// Bags of ROS 1 in a folder, by name.
fn ros1_files(folder: &Path) -> Vec<PathBuf> {
    let found = files_of(folder, ".bag").unwrap_or_default().into_iter().map(|(_, path)| path);
    found.filter(|path| matches!(Kind::from_file(path), Ok(Some(Kind::Ros1)))).collect()
}

/// The files of a bag.
pub(super) fn files(folder: &Path) -> Result<FolderFiles, ImportError> {
    let path = folder.join(METADATA);
    if !path.is_file() {
        return Ok(FolderFiles { files: ros1_files(folder), is_zstd: false, in_order: false });
    }
    if path.metadata().at(&path)?.len() > MAX_METADATA {
        return Err(ImportError::at(&path, format!("has more than {MAX_METADATA} bytes")));
    }
    let text = regular_file::read_to_string(&path).at(&path)?;
    let mode = value(&text, "compression_mode:").unwrap_or_default().to_uppercase();
    let format = value(&text, "compression_format:").unwrap_or_default();
    let is_zstd = match (mode.as_str(), format) {
        ("" | "NONE" | "STORAGE", _) | ("FILE", ZSTD) => false,
        ("MESSAGE", ZSTD) => true,
        _ => {
            let rule = format!(
                "compression_mode {mode}, compression_format {format:?}: must be files or messages compressed by zstd; convert \
                 the bag: `ros2 bag convert -i {} -o out.yaml` with compression_mode \"\"",
                files::shell::path(folder)
            );
            return Err(ImportError::at(&path, rule));
        }
    };
    let is_inside = |name: &str| {
        Path::new(name).components().all(|component| matches!(component, Component::Normal(_) | Component::CurDir))
    };
    if let Some(name) = file_names(&text).find(|name| !is_inside(name)) {
        let rule = format!("relative_file_paths has {name:?}; must be a file in the folder of the bag, without `..`");
        return Err(ImportError::at(&path, rule));
    }
    let files = file_names(&text).map(|name| existing(&folder.join(name))).collect::<Vec<_>>();
    if files.is_empty() {
        return Err(ImportError::at(&path, "names no files under relative_file_paths"));
    }
    Ok(FolderFiles { files, is_zstd, in_order: true })
}

/// The file, or its compressed form: some recorders list names without the extension.
fn existing(path: &Path) -> PathBuf {
    let mut compressed = path.as_os_str().to_owned();
    compressed.push(".");
    compressed.push(ZSTD);
    let compressed = PathBuf::from(compressed);
    if !path.exists() && compressed.exists() { compressed } else { path.to_owned() }
}

/// The file itself, or its content in the folder `scratch` if the complete file is compressed.
pub(super) fn decompressed(path: &Path, scratch: &Path) -> Result<PathBuf, ImportError> {
    if path.extension().is_none_or(|extension| extension != ZSTD) {
        return Ok(path.to_owned());
    }
    std::fs::create_dir_all(scratch).at(scratch)?;
    let plain = scratch.join(path.file_stem().unwrap_or_default());
    let file = regular_file::open(path).at(path)?;
    let limit = file.metadata().at(path)?.len().saturating_mul(MAX_RATIO);
    let content = stream(ZSTD, BufReader::new(file)).at(path)?;
    let mut out = File::create(&plain).at(&plain)?;
    let n_bytes = io::copy(&mut content.take(limit + 1), &mut out).at(path)?;
    if n_bytes > limit {
        return Err(ImportError::at(
            path,
            format!("has more than {MAX_RATIO} bytes per compressed byte: it is damaged"),
        ));
    }
    Ok(plain)
}

/// The value after a key, on any level.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.lines().find_map(|line| line.trim().strip_prefix(key)).map(unquoted)
}

fn unquoted(text: &str) -> &str {
    text.trim().trim_matches(['"', '\''])
}

/// The list after `relative_file_paths`.
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

    #[test]
    fn description_names_files_of_the_bag_only() {
        let folder = tempfile::tempdir().expect("a folder");
        let named = |name: &str| {
            let text = format!("rosbag2_bagfile_information:\n  relative_file_paths:\n    - {name}\n");
            std::fs::write(folder.path().join(METADATA), text).expect("written");
            files(folder.path()).map(|found| found.files.len()).map_err(|error| error.to_string())
        };
        assert_eq!(named("part/a_0.mcap"), Ok(1));
        for name in ["/etc/passwd", "../other/a_0.mcap", "part/../../a_0.mcap"] {
            let text = named(name).expect_err(name);
            assert!(text.contains(&format!("relative_file_paths has {name:?}")), "{text}");
        }
    }
}
