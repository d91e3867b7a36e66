//! Chunks of LAZ of the point formats 6 to 10: the first record, the number of points, the length of each layer, and the layers.
//!
//! The decoder reserves memory of the stated lengths. They are checked first: a chunk in memory is never longer than in
//! the file.

use laz::laszip::ChunkTable;
use laz::{LazItem, LazItemType, LazVlr};
use std::io::{Read, Seek, SeekFrom};

/// Code of this compression in the record "laszip encoded".
const LAYERED: u16 = 3;
/// Bytes of the position of the chunk table, before the first chunk.
const TABLE_PLACE_BYTES: u64 = 8;

/// Whether records are compressed in layers. Fails if the file contradicts itself. `vlr` was read from `bytes`.
pub(super) fn are_layers(bytes: &[u8], vlr: &LazVlr) -> Result<bool, String> {
    let code = bytes.first_chunk().map_or(0, |code| u16::from_le_bytes(*code));
    let n_layered = vlr.items().iter().filter(|item| item.version() > 2).count();
    match (code == LAYERED, n_layered) {
        (false, 0) => Ok(false),
        (true, n) if n > 0 && n == vlr.items().len() => Ok(true),
        (_, n) => Err(format!("compressor {code}, but {n} of {} parts of a record are in layers", vlr.items().len())),
    }
}

/// Layers and bytes of a part of a record.
fn size_of(item: LazItem) -> Option<(u64, u64)> {
    match item.item_type() {
        LazItemType::Point14 => Some((9, 30)),
        LazItemType::RGB14 => Some((1, 6)),
        LazItemType::RGBNIR14 => Some((2, 8)),
        LazItemType::WavePacket14 => Some((1, 29)),
        LazItemType::Byte14(n) => Some((u64::from(n), u64::from(n))),
        _ => None,
    }
}

/// Fails unless the file holds all layers of the chunks of its points.
pub(super) fn check(
    mut source: impl Read + Seek,
    vlr: &LazVlr,
    data_at: u64,
    n_bytes: u64,
    n_points: u64,
) -> Result<(), String> {
    let sizes: Option<Vec<(u64, u64)>> = vlr.items().iter().copied().map(size_of).collect();
    let sizes = sizes.ok_or("a part of a record has no layers")?;
    let (n_layers, record_bytes) = sizes.iter().fold((0, 0), |sum, size| (sum.0 + size.0, sum.1 + size.1));
    if record_bytes != vlr.items_size() {
        return Err(format!("records of {} bytes; their parts have {record_bytes}", vlr.items_size()));
    }
    let failed = |error: std::io::Error| format!("chunks: {error}");
    source.seek(SeekFrom::Start(data_at)).map_err(failed)?;
    let table = ChunkTable::read_from(&mut source, vlr).map_err(|error| format!("table of the chunks: {error}"))?;
    let mut at = data_at + TABLE_PLACE_BYTES;
    let mut left = n_points;
    let mut lengths = vec![0; 4 * n_layers as usize];
    for chunk in 0.. {
        if left == 0 {
            break;
        }
        source.seek(SeekFrom::Start(at + record_bytes + 4)).map_err(failed)?;
        source.read_exact(&mut lengths).map_err(|error| format!("chunk {chunk} at byte {at}: {error}"))?;
        let (words, _) = lengths.as_chunks::<4>();
        let layers_bytes: u64 = words.iter().map(|word| u64::from(u32::from_le_bytes(*word))).sum();
        let layers_at = at + record_bytes + 4 + lengths.len() as u64;
        at = layers_at + layers_bytes;
        if at > n_bytes {
            return Err(format!(
                "chunk {chunk}: layers of {layers_bytes} bytes from byte {layers_at} on; the file has {n_bytes}: it is damaged"
            ));
        }
        let n_in_chunk = if vlr.uses_variable_size_chunks() {
            table.as_ref().get(chunk).map_or(0, |entry| entry.point_count)
        } else {
            u64::from(vlr.chunk_size())
        };
        if n_in_chunk == 0 {
            return Err(format!("chunk {chunk} has no points; {left} are missing"));
        }
        left = left.saturating_sub(n_in_chunk);
    }
    Ok(())
}
