//! The stage's part of a state file, packed: blocks of rows, each with the first bytes of all rows, then the second
//! bytes, and so on, compressed by LZ4. Rows of points shrink to less than half their size.
//!
//! | bytes of a block | content |
//! |---|---|
//! | u32 | length unpacked, up to 256 KiB |
//! | u32 | length packed; the same if the block is not packed |
//! | u16 | bytes of a row |
//! | the rest | the rows |

use lz4_flex::block::{compress_into, decompress_into, get_maximum_output_size};

/// Bytes that are packed at a time: few enough to stay in the cache.
pub(crate) const BLOCK: usize = 256 << 10;
/// Bytes before the rows of a block.
const HEAD: usize = 10;
/// Images hardly shrink. Rows are written unpacked if their first block does not shrink by this share.
const LEAST_GAIN: f64 = 1.0 / 16.0;

/// Rows of one length, or arbitrary bytes (length 1).
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// The rows.
    pub bytes: &'a [u8],
    /// Bytes of a row, 1 to 65535.
    pub row_bytes: usize,
}

impl<'a> Piece<'a> {
    /// Bytes that are not rows.
    pub fn plain(bytes: &'a [u8]) -> Self {
        Self { bytes, row_bytes: 1 }
    }
}

/// Passes the blocks of a piece to `take`.
pub(crate) fn pack<E>(piece: Piece<'_>, mut take: impl FnMut(&[u8]) -> Result<(), E>) -> Result<(), E> {
    let row_bytes = piece.row_bytes.clamp(1, usize::from(u16::MAX));
    let block_bytes = (BLOCK / row_bytes).max(1) * row_bytes;
    let mut columns = vec![0; BLOCK];
    let mut block = vec![0; HEAD + get_maximum_output_size(BLOCK)];
    let mut is_worth_it = true;
    for rows in piece.bytes.chunks(block_bytes) {
        let columns = &mut columns[..rows.len()];
        transpose(rows, row_bytes, columns);
        let packed = if is_worth_it { compress_into(columns, &mut block[HEAD..]).ok() } else { None };
        let least = (rows.len() as f64 * (1.0 - LEAST_GAIN)) as usize;
        let n_packed = packed.filter(|n_packed| *n_packed <= least).unwrap_or_else(|| {
            is_worth_it = false;
            block[HEAD..HEAD + rows.len()].copy_from_slice(rows);
            rows.len()
        });
        block[..4].copy_from_slice(&(rows.len() as u32).to_le_bytes());
        block[4..8].copy_from_slice(&(n_packed as u32).to_le_bytes());
        block[8..HEAD].copy_from_slice(&(row_bytes as u16).to_le_bytes());
        take(&block[..HEAD + n_packed])?;
    }
    Ok(())
}

/// Unpacks all blocks. The error describes the first invalid block.
pub(crate) fn unpack(mut packed: &[u8]) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut columns = vec![0; BLOCK];
    while !packed.is_empty() {
        let (head, rest) = packed.split_first_chunk::<HEAD>().ok_or("a block of a few bytes")?;
        let u32_at = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]) as usize;
        let n_rows_bytes = u32_at(0);
        let n_packed = u32_at(4);
        let row_bytes = usize::from(u16::from_le_bytes([head[8], head[9]]));
        if n_rows_bytes > BLOCK || row_bytes == 0 {
            return Err(format!("a block of {n_rows_bytes} bytes with rows of {row_bytes}"));
        }
        let (content, later) = rest.split_at_checked(n_packed).ok_or("a block that is cut")?;
        packed = later;
        if n_packed == n_rows_bytes {
            bytes.extend_from_slice(content);
            continue;
        }
        let columns = &mut columns[..n_rows_bytes];
        match decompress_into(content, columns) {
            Ok(n) if n == n_rows_bytes => {}
            Ok(n) => return Err(format!("a block of {n} bytes, expected {n_rows_bytes}")),
            Err(error) => return Err(error.to_string()),
        }
        let begin = bytes.len();
        bytes.resize(begin + n_rows_bytes, 0);
        rows_of(columns, row_bytes, &mut bytes[begin..]);
    }
    Ok(bytes)
}

/// Transposes rows to columns of bytes. Bytes after the last whole row stay behind them.
fn transpose(rows: &[u8], row_bytes: usize, columns: &mut [u8]) {
    let n_rows = rows.len() / row_bytes;
    for (k, column) in columns[..n_rows * row_bytes].chunks_exact_mut(n_rows.max(1)).enumerate() {
        for (to, row) in column.iter_mut().zip(rows.chunks_exact(row_bytes)) {
            *to = row[k];
        }
    }
    columns[n_rows * row_bytes..].copy_from_slice(&rows[n_rows * row_bytes..]);
}

/// The inverse of [`transpose`].
fn rows_of(columns: &[u8], row_bytes: usize, rows: &mut [u8]) {
    let n_rows = columns.len() / row_bytes;
    for (k, column) in columns[..n_rows * row_bytes].chunks_exact(n_rows.max(1)).enumerate() {
        for (from, row) in column.iter().zip(rows.chunks_exact_mut(row_bytes)) {
            row[k] = *from;
        }
    }
    rows[n_rows * row_bytes..].copy_from_slice(&columns[n_rows * row_bytes..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(bytes: &[u8], row_bytes: usize) -> Vec<u8> {
        let mut packed = Vec::new();
        let taken = pack(Piece { bytes, row_bytes }, |block| {
            packed.extend_from_slice(block);
            Ok::<_, ()>(())
        });
        taken.expect("takes all");
        packed
    }

    /// Rows of 28 bytes with slowly changing values, such as points.
    fn rows(n: u32) -> Vec<u8> {
        (0..n).flat_map(|i| (0..7).flat_map(move |k| (i * (k + 3) + i * i % 7).to_le_bytes())).collect()
    }

    #[test]
    fn rows_become_shorter_and_come_back() {
        let bytes = [rows(20_000), vec![1, 2, 3]].concat();
        let by_rows = packed(&bytes, 28);
        assert_eq!(unpack(&by_rows).expect("unpacks"), bytes);
        assert!(by_rows.len() < bytes.len() / 2, "{} of {}", by_rows.len(), bytes.len());
        assert!(by_rows.len() < packed(&bytes, 1).len(), "the columns are more alike than the rows");
        for (bytes, row_bytes) in [(&[][..], 4), (&[7][..], 4), (&bytes[..=BLOCK], 1), (&bytes[..BLOCK], 70_000)] {
            assert_eq!(unpack(&packed(bytes, row_bytes)).expect("unpacks"), bytes);
        }
    }

    #[test]
    fn noise_is_written_as_it_is() {
        let mut state = 1_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        };
        let bytes: Vec<u8> = (0..BLOCK * 2).map(|_| noise()).collect();
        let packed = packed(&bytes, 1);
        assert_eq!(packed.len(), bytes.len() + 2 * HEAD);
        assert_eq!(unpack(&packed).expect("unpacks"), bytes);
    }

    #[test]
    fn damaged_blocks_are_refused_without_a_panic() {
        let good = packed(&rows(300), 28);
        for cut in 1..good.len() {
            assert!(unpack(&good[..cut]).is_err(), "cut to {cut}");
        }
        for at in 0..good.len() {
            let mut changed = good.clone();
            changed[at] ^= 0xff;
            let _ = unpack(&changed);
        }
        assert!(unpack(&[0; HEAD]).is_err_and(|error| error.contains("rows of 0")));
    }
}
