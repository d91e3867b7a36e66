//! Checks the lengths of texts in a record before the library reads it, because the library reserves memory for any length.

use super::error::RecordFault;
use mcap::records::op;

/// Whether all texts of a schema, channel, metadata or chunk record lie within it.
pub(super) fn check(opcode: u8, body: &[u8]) -> Result<(), RecordFault> {
    // Bytes before the first text, number of texts, whether a map of texts follows.
    let (record, begin, n_texts, has_map) = match opcode {
        op::SCHEMA => ("schema", 2, 2, false),
        op::CHANNEL => ("channel", 4, 2, true),
        op::METADATA => ("metadata", 0, 1, true),
        op::CHUNK => ("chunk", 28, 1, false),
        _ => return Ok(()),
    };
    let mut rest = body.get(begin..).unwrap_or_default();
    for _ in 0..n_texts {
        rest = skip_text(record, rest)?;
    }
    if !has_map {
        return Ok(());
    }
    let Some((length, after)) = rest.split_first_chunk::<4>() else { return Ok(()) };
    let length = u32::from_le_bytes(*length) as usize;
    let too_long = RecordFault::TextLength { record, found: length as u64, left: after.len() };
    let mut map = after.get(..length).ok_or(too_long)?;
    while !map.is_empty() {
        // A key and its value. The library reads both, even past the end of the map.
        for _ in 0..2 {
            if map.len() < size_of::<u32>() {
                return Err(RecordFault::TextLength { record, found: size_of::<u32>() as u64, left: map.len() });
            }
            map = skip_text(record, map)?;
        }
    }
    Ok(())
}

/// The bytes after a text. A record that ends before the length is refused by the library.
fn skip_text<'a>(record: &'static str, bytes: &'a [u8]) -> Result<&'a [u8], RecordFault> {
    let Some((length, rest)) = bytes.split_first_chunk::<4>() else { return Ok(&[]) };
    let found = u32::from_le_bytes(*length);
    let fault = RecordFault::TextLength { record, found: u64::from(found), left: rest.len() };
    rest.get(found as usize..).ok_or(fault)
}
