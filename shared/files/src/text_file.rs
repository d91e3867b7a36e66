//! Hand-written files, read in bounded memory: a regular file of limited size.

use crate::regular_file;
use crate::toml_nesting::{TooDeep, check_nesting};
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest launch file or manifest, bytes. A manifest with a hundred cameras needs a twentieth of it.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;
/// Largest calibration file of a manufacturer, bytes. Real ones have up to 300 KB.
pub const MAX_CALIBRATION_BYTES: u64 = 16 << 20;

/// Error of a file that is not read.
#[derive(Debug, thiserror::Error)]
pub enum TextFileError {
    /// The operating system reported an error, or the bytes are not text.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file is a device, a pipe or a folder, which may never end.
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
    let mut bytes = Vec::new();
    // The file may grow, or report no size like the files of /proc.
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(TextFileError::TooLarge { limit }) } else { Ok(text_from_bytes(bytes)?) }
}

/// Reads a text of at most [`regular_file::MAX_BYTES`], as [`text_from_bytes`].
pub fn read_long_text(path: &Path) -> io::Result<String> {
    text_from_bytes(regular_file::read(path)?)
}

/// The text of a file in UTF-8, or in UTF-16 with a byte order mark, as editors and spreadsheets of Windows write it. The mark is removed.
/// The error names the first byte that is not text.
pub fn text_from_bytes(bytes: Vec<u8>) -> io::Result<String> {
    let fault = |text: String| io::Error::new(io::ErrorKind::InvalidData, text);
    let utf16 = |unit: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: Result<String, _> = char::decode_utf16(units).collect();
        text.map_err(|error| fault(format!("is not UTF-16: {error}; save it as UTF-8")))
    };
    match bytes[..] {
        [0xff, 0xfe, ..] => utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf16(u16::from_be_bytes),
        _ => match String::from_utf8(bytes) {
            Ok(text) => Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text)),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let line = error.as_bytes()[..at].split(|byte| *byte == b'\n').count();
                let byte = error.as_bytes()[at];
                Err(fault(format!(
                    "byte {at} (line {line}) is {byte:#04x}, which is not UTF-8; save the file as UTF-8"
                )))
            }
        },
    }
}

/// Error of a TOML file that is not read.
#[derive(Debug, thiserror::Error)]
pub enum ReadTomlError {
    /// The text is not read.
    #[error(transparent)]
    Text(#[from] TextFileError),
    /// Brackets are nested too deeply.
    #[error("byte {}: {rule}", rule.at)]
    TooDeep {
        /// Position, and the number of allowed levels.
        #[from]
        rule: TooDeep,
    },
    /// The file is not TOML, or an entry is missing, unknown or of another type; the error names the line.
    #[error(transparent)]
    Toml(#[from] toml::de::Error),
}

/// Reads a TOML file of at most [`MAX_SETTINGS_BYTES`] that a program of the project has written, or that has few
/// entries: only the first problem is reported. For other files, see [`TomlFile`](crate::toml_file::TomlFile).
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, ReadTomlError> {
    let text = read_text(path, MAX_SETTINGS_BYTES)?;
    check_nesting(&text)?;
    Ok(toml::from_str(&text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_file_with_too_many_brackets_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).expect("writes");
            read_toml::<toml::Table>(&path).map_err(|error| error.to_string())
        };
        assert_eq!(read("a = 1").expect("reads")["a"].as_integer(), Some(1));
        let too_deep = "byte 150: more than 100 arrays and inline tables are open here";
        assert_eq!(read(&"[[=".repeat(8000)).expect_err("refused"), too_deep);
        assert!(read("a = ").expect_err("refused").contains("line 1"));
    }

    #[test]
    fn text_with_a_byte_order_mark_is_read_and_other_bytes_are_named() {
        let utf16 = |unit: fn(u16) -> [u8; 2]| "\u{feff}1,5\r\n".encode_utf16().flat_map(unit).collect::<Vec<u8>>();
        for bytes in ["1,5\r\n".into(), "\u{feff}1,5\r\n".into(), utf16(u16::to_le_bytes), utf16(u16::to_be_bytes)] {
            assert_eq!(text_from_bytes(bytes).expect("is text"), "1,5\r\n");
        }
        let refused = |bytes: &[u8]| text_from_bytes(bytes.to_vec()).expect_err("refused").to_string();
        assert_eq!(refused(b"a\n\xe9"), "byte 2 (line 2) is 0xe9, which is not UTF-8; save the file as UTF-8");
        assert!(refused(b"\xff\xfe\x00\xd8").starts_with("is not UTF-16"));
    }

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
