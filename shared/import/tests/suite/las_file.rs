//! LAS and LAZ files for tests.

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use std::io::Cursor;

/// Bytes of the header of LAS 1.2.
const HEADER_BYTES: usize = 227;
/// Bytes of a record of point format 1.
pub const RECORD_BYTES: usize = 28;

/// A point: x y z in m, intensity, time in s.
pub type Row = ([f64; 3], u16, f64);

/// A file of point format 1 with a scale of 0.1 mm.
pub fn las(rows: &[Row], is_compressed: bool) -> Vec<u8> {
    let items = LazItemRecordBuilder::default_for_point_format_id(1, 0).expect("is a format");
    file(1, rows, is_compressed.then(|| LazVlr::from_laz_items(items)), &|_| [0; 2])
}

/// A file with these bytes 15 and 16 of each point, by its index: point format 1, or the layered point format 6.
pub fn classified(format: u8, rows: &[Row], bytes: &dyn Fn(usize) -> [u8; 2]) -> Vec<u8> {
    let items = || LazItemRecordBuilder::default_for_point_format_id(format, 2).expect("is a format");
    file(format, rows, (format > 5).then(|| LazVlr::from_laz_items(items())), bytes)
}

/// A file of point format 6 or above, compressed in layers. `chunk`: points of each chunk; `None` for chunks of different
/// sizes.
pub fn layered_laz(format: u8, rows: &[Row], chunk: Option<u32>) -> Vec<u8> {
    let items = LazItemRecordBuilder::default_for_point_format_id(format, 2).expect("is a format");
    let vlr = LazVlrBuilder::new(items);
    let vlr = match chunk {
        Some(size) => vlr.with_fixed_chunk_size(size),
        None => vlr.with_variable_chunk_size(),
    };
    file(format, rows, Some(vlr.build()), &|_| [0; 2])
}

fn file(format: u8, rows: &[Row], vlr: Option<LazVlr>, class_bytes: &dyn Fn(usize) -> [u8; 2]) -> Vec<u8> {
    let record_bytes = vlr.as_ref().map_or(RECORD_BYTES, |vlr| vlr.items_size() as usize);
    let time_at = if format > 5 { 22 } else { 20 };
    let mut records = Vec::new();
    for (index, (position, intensity, time_s)) in rows.iter().enumerate() {
        let mut record = vec![0; record_bytes];
        for (axis, value) in position.iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&((value / 1e-4).round() as i32).to_le_bytes());
        }
        record[12..14].copy_from_slice(&intensity.to_le_bytes());
        record[15..17].copy_from_slice(&class_bytes(index));
        record[time_at..time_at + 8].copy_from_slice(&time_s.to_le_bytes());
        // Colors and extra bytes that change.
        record[time_at + 8..].fill(index as u8);
        records.push(record);
    }
    let mut head = vec![0; HEADER_BYTES];
    head[..4].copy_from_slice(b"LASF");
    head[24..26].copy_from_slice(&[1, 2]);
    head[94..96].copy_from_slice(&(HEADER_BYTES as u16).to_le_bytes());
    head[105..107].copy_from_slice(&(record_bytes as u16).to_le_bytes());
    head[107..111].copy_from_slice(&(rows.len() as u32).to_le_bytes());
    for k in 0..3 {
        head[131 + 8 * k..139 + 8 * k].copy_from_slice(&1e-4_f64.to_le_bytes());
    }
    let Some(vlr) = vlr else {
        head[104] = format;
        head[96..100].copy_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
        return [head, records.concat()].concat();
    };
    head[104] = 0x80 | format;
    head[100] = 1;
    let has_own_chunks = vlr.uses_variable_size_chunks();
    let mut description = Vec::new();
    vlr.write_to(&mut description).expect("writes");
    let mut record = vec![0; 54];
    record[2..16].copy_from_slice(b"laszip encoded");
    record[18..20].copy_from_slice(&22_204_u16.to_le_bytes());
    record[20..22].copy_from_slice(&(description.len() as u16).to_le_bytes());
    let data_at = HEADER_BYTES + record.len() + description.len();
    head[96..100].copy_from_slice(&(data_at as u32).to_le_bytes());
    let mut file = Cursor::new([head, record, description].concat());
    file.set_position(data_at as u64);
    let mut compressor = LasZipCompressor::new(&mut file, vlr).expect("opens");
    for (index, record) in records.iter().enumerate() {
        // Chunks of 70, 71, ... points.
        if has_own_chunks && index % 70 == 69 {
            compressor.finish_current_chunk().expect("ends");
        }
        compressor.compress_one(record).expect("compresses");
    }
    compressor.done().expect("ends");
    drop(compressor);
    file.into_inner()
}
