//! Messages that are compressed one by one (`compression_mode: MESSAGE`).

use super::MAX_MESSAGE;
use super::decompress::decompressed as stream;
use std::io::Read;

/// The content of a message.
pub(super) fn decompressed(data: &[u8]) -> Result<Vec<u8>, String> {
    let mut content = Vec::new();
    let fault = |error: std::io::Error| format!("the message is not compressed by zstd: {error}");
    stream("zstd", data).map_err(fault)?.take(MAX_MESSAGE + 1).read_to_end(&mut content).map_err(fault)?;
    if content.len() as u64 > MAX_MESSAGE {
        return Err(format!("the message has more than {MAX_MESSAGE} bytes"));
    }
    Ok(content)
}
