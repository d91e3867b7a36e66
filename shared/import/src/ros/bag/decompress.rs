//! Decompression of chunks: the compressions of recordings, and bzip2 of ROS 1.

pub(super) use recording::compression::ContentLimit;
use std::io::{self, Read};

/// The content of a chunk.
pub(super) fn decompressed<'a>(compression: &str, chunk: impl Read + 'a) -> io::Result<Box<dyn Read + 'a>> {
    match compression {
        "bz2" => Ok(Box::new(bzip2::read::BzDecoder::new(chunk))),
        other => recording::compression::decompressed(other, chunk).map_err(|error| match error.kind() {
            io::ErrorKind::Unsupported => io::Error::new(error.kind(), format!("{error}, or bz2")),
            _ => error,
        }),
    }
}
