//! LAS and LAZ files for tests.

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr};
use std::io::Cursor;

/// Bytes of the header of LAS 1.2.
const HEADER_BYTES: usize = 227;
/// Bytes of a record of point format 1.
pub const RECORD_BYTES: usize = 28;

/// A point: x y z in m, intensity, time in s.
pub type Row = ([f64; 3], u16, f64);

/// A file of point format 1 with a scale of 0.1 mm.
pub fn las(rows: &[Row], is_compressed: bool) -> Vec<u8> {
    let mut records = Vec::new();
    for (position, intensity, time_s) in rows {
        for value in position {
            records.extend(((value / 1e-4).round() as i32).to_le_bytes());
        }
        records.extend(intensity.to_le_bytes());
        records.extend([0; 6]);
        records.extend(time_s.to_le_bytes());
    }
    let mut head = vec![0; HEADER_BYTES];
    head[..4].copy_from_slice(b"LASF");
    head[24..26].copy_from_slice(&[1, 2]);
    head[94..96].copy_from_slice(&(HEADER_BYTES as u16).to_le_bytes());
    head[105..107].copy_from_slice(&(RECORD_BYTES as u16).to_le_bytes());
    head[107..111].copy_from_slice(&(rows.len() as u32).to_le_bytes());
    for k in 0..3 {
        head[131 + 8 * k..139 + 8 * k].copy_from_slice(&1e-4_f64.to_le_bytes());
    }
    if !is_compressed {
        head[104] = 1;
        head[96..100].copy_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
        return [head, records].concat();
    }
    head[104] = 0x81;
    head[100] = 1;
    let items = LazItemRecordBuilder::default_for_point_format_id(1, 0).expect("is a format");
    let vlr = LazVlr::from_laz_items(items);
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
    compressor.compress_many(&records).expect("compresses");
    compressor.done().expect("ends");
    drop(compressor);
    file.into_inner()
}
