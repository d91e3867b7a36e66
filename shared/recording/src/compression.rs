//! Decompression of chunks in recordings, within a limit on their content.

use std::io::{self, Read};

/// Minimum limit of the content of all chunks, for small files, bytes.
const MIN_CONTENT: u64 = 16 << 20;
/// Limit of the content of all chunks, in multiples of the file size. Recordings reach a tenth of it; bzip2 and zstd
/// reach a million.
const MAX_RATIO: u64 = 256;

/// Bytes of content that the chunks of a file may still have. The limit bounds the time to read a file by its length.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContentLimit {
    limit: u64,
    left: u64,
}

impl ContentLimit {
    /// The limit for a file of this length.
    pub fn for_file(n_bytes: u64) -> Self {
        let limit = n_bytes.saturating_mul(MAX_RATIO).saturating_add(MIN_CONTENT);
        Self { limit, left: limit }
    }

    /// Subtracts the content of a chunk.
    pub fn take(&mut self, n_bytes: u64) -> io::Result<()> {
        let limit = self.limit;
        let left = self.left.checked_sub(n_bytes).ok_or_else(|| {
            let rule = format!(
                "the chunks up to here contain more than {limit} bytes, {MAX_RATIO} times the file: it is damaged"
            );
            io::Error::new(io::ErrorKind::InvalidData, rule)
        })?;
        self.left = left;
        Ok(())
    }
}

/// The content of a chunk with a compression of the MCAP registry.
pub fn decompressed<'a>(compression: &str, chunk: impl Read + 'a) -> io::Result<Box<dyn Read + 'a>> {
    match compression {
        "" | "none" => Ok(Box::new(chunk)),
        "lz4" => Ok(Box::new(lz4_flex::frame::FrameDecoder::new(chunk))),
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(chunk);
            Ok(Box::new(decoder.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.to_string()))?))
        }
        other => Err(io::Error::new(
            io::ErrorKind::Unsupported,
            format!("chunk with compression {other:?}; must be none, lz4 or zstd"),
        )),
    }
}
