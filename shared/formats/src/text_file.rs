//! Hand-written files, read in bounded memory: a regular file of limited size.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest launch file or manifest, bytes. A manifest with a hundred cameras has a twentieth.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;
/// Largest calibration file of a manufacturer, bytes. Real ones have up to 300 KB.
pub const MAX_CALIBRATION_BYTES: u64 = 16 << 20;

/// A file that is not read.
#[derive(Debug, thiserror::Error)]
pub enum TextFileError {
    /// The operating system reported an error, or the text is not UTF-8.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// A device, a pipe or a folder: it may never end.
    #[error("is not a regular file")]
    NotRegular,
    /// The file is too large.
    #[error("has more than {limit} bytes, the limit for such a file")]
    TooLarge {
        /// Most bytes.
        limit: u64,
    },
}

impl TextFileError {
    /// Whether there is no such file.
    pub fn is_absent(&self) -> bool {
        matches!(self, Self::Io(error) if error.kind() == io::ErrorKind::NotFound)
    }
}

/// Reads a text of at most `limit` bytes.
pub fn read_text(path: &Path, limit: u64) -> Result<String, TextFileError> {
    // Opening a pipe would wait for its writer.
    if !path.metadata()?.is_file() {
        return Err(TextFileError::NotRegular);
    }
    let mut text = String::new();
    // The file may grow, or have no size, as those of /proc.
    File::open(path)?.take(limit + 1).read_to_string(&mut text)?;
    if text.len() as u64 > limit { Err(TextFileError::TooLarge { limit }) } else { Ok(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn device_folder_or_large_file_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |path: &Path| read_text(path, 100).expect_err("refused").to_string();
        assert_eq!(refused(Path::new("/dev/zero")), "is not a regular file");
        assert_eq!(refused(folder.path()), "is not a regular file");
        let path = folder.path().join("a.toml");
        assert!(read_text(&path, 100).expect_err("is absent").is_absent());
        std::fs::write(&path, "x".repeat(100)).expect("writes");
        assert_eq!(read_text(&path, 100).expect("reads").len(), 100);
        std::fs::write(&path, "x".repeat(101)).expect("writes");
        assert_eq!(refused(&path), "has more than 100 bytes, the limit for such a file");
    }
}
