//! The shared key of both hosts. It permits the start of any program in the agent's folder.

use crate::LinkError;
use files::regular_file;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{Error, Read, Write as _};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;

/// Bytes of a key, as defined by the Noise protocol.
const KEY_BYTES: usize = 32;

/// A shared key of 256 bits. Its file has 64 hexadecimal digits.
pub struct Key(pub(crate) [u8; KEY_BYTES]);

impl Key {
    /// Writes a new random key to a file that does not exist yet and that only its owner can read.
    pub fn create(file: &Path) -> Result<(), LinkError> {
        let failed = |source: Error| LinkError::KeyFile { file: file.to_owned(), source };
        let mut key = [0; KEY_BYTES];
        File::open("/dev/urandom").and_then(|mut random| random.read_exact(&mut key)).map_err(failed)?;
        let mut text = String::new();
        for byte in key {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        text.push('\n');
        let mut options = File::options();
        let created = options.write(true).create_new(true).mode(0o600).open(file);
        created.and_then(|mut created| created.write_all(text.as_bytes())).map_err(failed)
    }

    /// Reads a key. A file that other users can read or write is refused.
    pub fn read(file: &Path) -> Result<Self, LinkError> {
        let failed = |source: Error| LinkError::KeyFile { file: file.to_owned(), source };
        let opened = regular_file::open(file).map_err(failed)?;
        let mode = opened.metadata().map_err(failed)?.permissions().mode() & 0o7777;
        if mode & 0o077 != 0 {
            return Err(LinkError::KeyMode { file: file.to_owned(), mode });
        }
        let mut text = String::new();
        // Two digits for each byte, a line break, and one more byte, so that a longer file is recognized.
        let limit = 2 * KEY_BYTES as u64 + 2;
        opened.take(limit).read_to_string(&mut text).map_err(failed)?;
        Self::from_hex(text.trim_end()).ok_or_else(|| LinkError::KeyContent { file: file.to_owned() })
    }

    fn from_hex(text: &str) -> Option<Self> {
        let digits: Option<Vec<u8>> = text.chars().map(|c| c.to_digit(16).map(|digit| digit as u8)).collect();
        let bytes: Vec<u8> = digits?.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect();
        let is_even = text.len().is_multiple_of(2);
        bytes.try_into().ok().filter(|_| is_even).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;

    #[test]
    fn new_key_is_private_and_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let one = folder.path().join("one");
        let two = folder.path().join("two");
        Key::create(&one).expect("created");
        Key::create(&two).expect("created");
        let keys = [&one, &two].map(|file| Key::read(file).expect("read").0);
        assert_ne!(keys[0], keys[1]);
        assert!(matches!(Key::create(&one), Err(LinkError::KeyFile { .. })), "an existing key is not replaced");
        assert_eq!(Key::read(&one).expect("read").0, keys[0]);
    }

    #[test]
    fn key_that_other_users_can_read_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("key");
        Key::create(&file).expect("created");
        for mode in [0o640, 0o604, 0o620] {
            std::fs::set_permissions(&file, Permissions::from_mode(mode)).expect("changed");
            let refused = Key::read(&file).err().expect("refused").to_string();
            assert!(refused.contains(&format!("mode {mode:04o} lets other users read the key")), "{refused}");
        }
    }

    #[test]
    fn file_that_is_no_key_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("key");
        let digits = "0123456789abcdef".repeat(4);
        let long = "0".repeat(66);
        for (text, is_key) in
            [(digits.as_str(), true), ("", false), (&digits[1..], false), (&long, false), ("g", false)]
        {
            std::fs::write(&file, text).expect("written");
            std::fs::set_permissions(&file, Permissions::from_mode(0o600)).expect("changed");
            assert_eq!(Key::read(&file).is_ok(), is_key, "{text}");
        }
    }
}
