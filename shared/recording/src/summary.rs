//! The summary at the end of a recording. Other programs declare a channel just before its first message; the summary
//! lists all channels.

use files::regular_file;

use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// The footer record (opcode, length, start of the summary, start of its offsets, checksum) and the magic after it.
const END_BYTES: u64 = 9 + 20 + 8;
/// Bytes of the footer record that its checksum covers.
const CHECKED_FOOTER_BYTES: usize = 9 + 16;

/// The records of the summary. `None` if the file, of `length` bytes, has no summary of at most `limit` bytes with a correct
/// checksum: reading the whole file reports the fault.
pub(super) fn read(path: &Path, length: u64, limit: u64) -> io::Result<Option<Vec<u8>>> {
    let Some(footer_at) = length.checked_sub(END_BYTES) else { return Ok(None) };
    let mut file = regular_file::open(path)?;
    file.seek(SeekFrom::Start(footer_at))?;
    let mut end = [0; END_BYTES as usize];
    file.read_exact(&mut end)?;
    let u64_at = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| end[at + i]));
    let begin = u64_at(9);
    let is_end = end[0] == mcap::records::op::FOOTER && end.ends_with(mcap::MAGIC);
    let n_bytes = footer_at.checked_sub(begin).filter(|n_bytes| is_end && begin > 0 && *n_bytes <= limit);
    let Some(n_bytes) = n_bytes else { return Ok(None) };
    file.seek(SeekFrom::Start(begin))?;
    let mut records = vec![0; n_bytes as usize];
    file.read_exact(&mut records)?;
    let mut sum = crc32fast::Hasher::new();
    sum.update(&records);
    sum.update(&end[..CHECKED_FOOTER_BYTES]);
    // 0: no checksum.
    let saved = u32::from_le_bytes(std::array::from_fn(|i| end[CHECKED_FOOTER_BYTES + i]));
    Ok((saved == 0 || saved == sum.finalize()).then_some(records))
}
