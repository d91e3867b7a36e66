//! Opening and reading of files that users name. A pipe would wait for its writer, a device may never end: only regular
//! files are opened, and reading a whole file has a limit.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest file that is read as a whole, bytes. The largest real ones, tables of data sets with 10^7 rows, have a third
/// of it.
pub const MAX_BYTES: u64 = 2 << 30;

/// Opens a regular file for reading.
pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
    let path = path.as_ref();
    // Before the file is opened, which waits for the writer of a pipe.
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("is not a regular file, but a folder, pipe or device"));
    }
    File::open(path)
}

/// Reads a regular file of at most [`MAX_BYTES`].
pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
    read_limited(path.as_ref(), MAX_BYTES)
}

/// Reads a regular file of at most [`MAX_BYTES`] in UTF-8.
pub fn read_to_string(path: impl AsRef<Path>) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.utf8_error()))
}

fn read_limited(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    // The file may grow, or report no size like the files of /proc.
    let mut bytes = Vec::with_capacity(file.metadata()?.len().min(limit) as usize);
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::other(format!(
            "has more than {limit} bytes, the limit for a file that is read as a whole"
        )));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_and_folders_are_refused_and_absent_files_are_named_as_such() {
        for path in ["/dev/zero", "/dev"] {
            let error = read(path).expect_err(path);
            assert_eq!(error.to_string(), "is not a regular file, but a folder, pipe or device");
        }
        assert_eq!(open("/nowhere").expect_err("absent").kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, "abc\u{e9}").expect("written");
        assert_eq!(read_to_string(&path).expect("text"), "abc\u{e9}");
        assert_eq!(read_limited(&path, 5).expect("fits").len(), 5);
        let error = read_limited(&path, 4).expect_err("too large");
        assert_eq!(error.to_string(), "has more than 4 bytes, the limit for a file that is read as a whole");
        std::fs::write(&path, b"\xff").expect("written");
        assert_eq!(read_to_string(&path).expect_err("no text").kind(), io::ErrorKind::InvalidData);
        // Files of /proc report no size.
        assert!(!read("/proc/self/status").expect("a regular file").is_empty());
    }
}
