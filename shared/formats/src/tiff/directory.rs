//! Checks the first directory of a file before the decoder reads it.
//!
//! The decoder reads the values of a directory into memory, 32 bytes for each, before its limits can be set.

use super::TiffError;

/// Fails if a value of the first directory has more bytes than the file. Damage of other kinds is left to the decoder.
pub(super) fn check(bytes: &[u8]) -> Result<(), TiffError> {
    for (tag, n_bytes) in entries(bytes).unwrap_or_default() {
        if n_bytes > bytes.len() as u64 {
            return Err(TiffError::Value { tag, found: n_bytes, n_bytes: bytes.len() });
        }
    }
    Ok(())
}

/// Tags and sizes of their values, bytes.
fn entries(bytes: &[u8]) -> Option<Vec<(u16, u64)>> {
    let is_big_endian = bytes.starts_with(b"MM");
    let number = |at: usize, n: usize| {
        let found = bytes.get(at..at.checked_add(n)?)?;
        let join = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        Some(if is_big_endian { found.iter().fold(0, join) } else { found.iter().rev().fold(0, join) })
    };
    // Sizes of offsets and of the number of entries: TIFF has 32 bits, BigTIFF 64.
    let (offset_at, wide, count) = if number(2, 2)? == 43 { (8, 8, 8) } else { (4, 4, 2) };
    let directory = usize::try_from(number(offset_at, wide)?).ok()?;
    let n_entries = number(directory, count)?;
    let entry_bytes = 4 + 2 * wide;
    let mut entries = Vec::new();
    for index in 0..usize::try_from(n_entries).ok()? {
        let at = index.checked_mul(entry_bytes)?.checked_add(directory)?.checked_add(count)?;
        // The decoder reports a directory that is cut.
        let (Some(tag), Some(kind), Some(n_values)) = (number(at, 2), number(at + 2, 2), number(at + 4, wide)) else {
            break;
        };
        let value_bytes = match kind {
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16 | 17 | 18 => 8,
            _ => 1,
        };
        entries.push((tag as u16, n_values.saturating_mul(value_bytes)));
    }
    Some(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_longer_than_the_file_is_refused() {
        let directory = |n_values: u32| {
            let entry = [258_u16.to_le_bytes(), 3_u16.to_le_bytes()].concat();
            let head = [b"II*\0".as_slice(), &8_u32.to_le_bytes(), &1_u16.to_le_bytes()].concat();
            [head, entry, n_values.to_le_bytes().to_vec(), vec![0; 8]].concat()
        };
        assert!(check(&directory(4)).is_ok());
        let error = check(&directory(8_000_000)).expect_err("is longer");
        assert!(error.to_string().contains("tag 258 has 16000000 bytes"), "{error}");
        for cut in 0..26 {
            let _ = check(&directory(4)[..cut]);
        }
    }
}
