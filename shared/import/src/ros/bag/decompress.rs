//! Decompression of chunks.

use std::io::{self, Read};

/// The content of a chunk.
pub(super) fn decompressed<'a>(compression: &str, chunk: impl Read + 'a) -> io::Result<Box<dyn Read + 'a>> {
    match compression {
        "" | "none" => Ok(Box::new(chunk)),
        "bz2" => Ok(Box::new(bzip2::read::BzDecoder::new(chunk))),
        "lz4" => Ok(Box::new(lz4_flex::frame::FrameDecoder::new(chunk))),
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(chunk);
            Ok(Box::new(decoder.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.to_string()))?))
        }
        other => Err(io::Error::new(
            io::ErrorKind::Unsupported,
            format!("chunk with compression {other:?}; must be none, bz2, lz4 or zstd"),
        )),
    }
}
