//! Compressed captures, which are not read: a run continues at a byte of a capture.

use super::is_capture_name;
use files::regular_file;
use std::fmt;
use std::io::Read;
use std::path::Path;

/// Compression of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// `*.gz`.
    Gzip,
    /// `*.bz2`.
    Bzip2,
    /// `*.xz`.
    Xz,
    /// `*.zst`.
    Zstandard,
}

impl Compression {
    const ALL: [Self; 4] = [Self::Gzip, Self::Bzip2, Self::Xz, Self::Zstandard];

    fn extension(self) -> &'static str {
        match self {
            Self::Gzip => "gz",
            Self::Bzip2 => "bz2",
            Self::Xz => "xz",
            Self::Zstandard => "zst",
        }
    }

    fn magic(self) -> &'static [u8] {
        match self {
            Self::Gzip => &[0x1f, 0x8b],
            Self::Bzip2 => b"BZh",
            Self::Xz => &[0xfd, b'7', b'z', b'X'],
            Self::Zstandard => &[0x28, 0xb5, 0x2f, 0xfd],
        }
    }

    pub(super) fn from_magic(bytes: [u8; 4]) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| bytes.starts_with(kind.magic()))
    }

    /// The compression of a capture: by its name, as `x.pcap.gz` or `x.pcap3.zst`, or by its first bytes if it is named as a
    /// capture. `None` for other files.
    pub fn find(path: &Path) -> Option<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let by_name = Self::ALL.into_iter().find(|kind| kind.extension() == extension);
        let stem = path.with_extension("");
        if by_name.is_some() && is_capture_name(&stem) {
            return by_name;
        }
        let mut begin = [0; 4];
        let read = regular_file::open(path).and_then(|mut file| file.read_exact(&mut begin));
        if is_capture_name(path) && read.is_ok() { Self::from_magic(begin) } else { None }
    }

    /// Name and command that decompresses.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::Gzip => ["gzip", "gunzip"],
            Self::Bzip2 => ["bzip2", "bunzip2"],
            Self::Xz => ["xz", "unxz"],
            Self::Zstandard => ["Zstandard", "unzstd"],
        }
    }
}

impl fmt::Display for Compression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [name, command] = self.words();
        write!(f, "is compressed with {name}; decompress it with `{command}`: captures are read from any byte")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compressed_captures_are_known_by_name_and_by_their_first_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("b.pcap"), [0x28, 0xb5, 0x2f, 0xfd, 0]).expect("writes");
        std::fs::write(at("c.pcap"), [0xd4, 0xc3, 0xb2, 0xa1, 0]).expect("writes");
        for (name, expected) in [
            ("a.pcap.gz", Some(Compression::Gzip)),
            ("a.PCAPNG.XZ", Some(Compression::Xz)),
            ("a.pcap12.bz2", Some(Compression::Bzip2)),
            ("b.pcap", Some(Compression::Zstandard)),
            ("c.pcap", None),
            ("notes.gz", None),
        ] {
            assert_eq!(Compression::find(&at(name)), expected, "{name}");
        }
        assert!(Compression::Gzip.to_string().contains("`gunzip`"));
    }
}
