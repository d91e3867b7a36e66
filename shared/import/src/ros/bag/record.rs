//! Reads records of known length.

use super::MAX_MESSAGE;
use crate::error::ImportError;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// A reader that can skip bytes.
pub(super) trait Skip: Read {
    fn skip(&mut self, n_bytes: u64) -> io::Result<()>;
}

impl Skip for BufReader<File> {
    fn skip(&mut self, n_bytes: u64) -> io::Result<()> {
        let n_bytes = i64::try_from(n_bytes).map_err(|_| io::Error::from(io::ErrorKind::UnexpectedEof))?;
        self.seek_relative(n_bytes)
    }
}

/// Content of a chunk.
impl Skip for Box<dyn Read + '_> {
    fn skip(&mut self, n_bytes: u64) -> io::Result<()> {
        let skipped = io::copy(&mut self.by_ref().take(n_bytes), &mut io::sink())?;
        if skipped < n_bytes { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
    }
}

/// Replaces the content of `bytes` with the next `n_bytes`. Memory grows with the available bytes, not with the length
/// that the file states.
pub(super) fn read_bytes(reader: &mut impl Read, n_bytes: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    bytes.clear();
    if n_bytes > MAX_MESSAGE {
        let rule = format!("a record of {n_bytes} bytes; at most {MAX_MESSAGE} are read");
        return Err(io::Error::new(io::ErrorKind::InvalidData, rule));
    }
    reader.by_ref().take(n_bytes).read_to_end(bytes)?;
    if (bytes.len() as u64) < n_bytes { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

/// The next bytes; `None` at the end of the data.
pub(super) fn array_or_end<const N: usize>(reader: &mut impl Read) -> io::Result<Option<[u8; N]>> {
    let mut bytes = [0; N];
    let mut n_read = 0;
    while n_read < N {
        match reader.read(&mut bytes[n_read..]) {
            Ok(0) if n_read == 0 => return Ok(None),
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => n_read += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(Some(bytes))
}

/// The next bytes.
pub(super) fn array<const N: usize>(reader: &mut impl Read) -> io::Result<[u8; N]> {
    array_or_end(reader)?.ok_or_else(|| io::ErrorKind::UnexpectedEof.into())
}

/// Content of a chunk, whose size and checksum are verified at its end.
pub(super) struct Checked<R> {
    content: R,
    left: u64,
    /// Checksum stated in the file, and checksum of the bytes so far; `None` if the file states no checksum.
    crc: Option<(u32, crc32fast::Hasher)>,
}

impl<R: Read> Checked<R> {
    /// A reader of `n_bytes` of content. A `crc` of 0 means no checksum.
    pub fn new(content: R, n_bytes: u64, crc: u32) -> Self {
        Self { content, left: n_bytes, crc: (crc != 0).then(|| (crc, crc32fast::Hasher::new())) }
    }
}

impl<R: Read> Read for Checked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let n = self.content.by_ref().take(self.left).read(buffer)?;
        self.left -= n as u64;
        if n == 0 {
            if self.left > 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if let Some((stated, found)) = self.crc.take().map(|(stated, hasher)| (stated, hasher.finalize()))
                && stated != found
            {
                let rule = format!("a chunk with checksum {found:#010x}; the file says {stated:#010x}: it is damaged");
                return Err(io::Error::new(io::ErrorKind::InvalidData, rule));
            }
        }
        if let Some((_, hasher)) = &mut self.crc {
            hasher.update(&buffer[..n]);
        }
        Ok(n)
    }
}

/// Names the place of an error of a file.
pub(super) trait AtByte<T> {
    fn at_byte(self, path: &Path, byte: u64) -> Result<T, ImportError>;
}

impl<T> AtByte<T> for io::Result<T> {
    fn at_byte(self, path: &Path, byte: u64) -> Result<T, ImportError> {
        self.map_err(|error| {
            let rule = match error.kind() {
                io::ErrorKind::UnexpectedEof => "the record ends early: the file is cut or damaged".to_owned(),
                _ => error.to_string(),
            };
            ImportError::at_part(path, &format!("byte {byte}"), rule)
        })
    }
}
