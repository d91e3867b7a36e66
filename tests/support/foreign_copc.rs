//! COPC files of other programs: without fields of this project, in any point format that COPC allows.

use laz::{LazItemRecordBuilder, LazVlrBuilder};
use std::io::Cursor;
use std::path::Path;

/// Points on each side of the square.
pub const SIDE: usize = 100;
/// Bytes of the header of LAS 1.4, of the head of a variable length record and of an extended one.
const HEADER: usize = 375;
const VLR: usize = 54;
const EVLR: usize = 60;
const SCALE_M: f64 = 0.01;

/// Writes a square of 100 x 100 points, 0.2 m apart, as one node. Half of it is ground, half is a building 3 m higher. `format` is 6, 7 or 8;
/// `rgb` the color of all points, if the format has one.
pub fn write_foreign_copc(path: &Path, format: u8, rgb: [u16; 3]) {
    let items = LazItemRecordBuilder::default_for_point_format_id(format, 0).expect("COPC allows it");
    let laz = LazVlrBuilder::new(items).with_variable_chunk_size().build();
    let records: Vec<u8> = (0..SIDE * SIDE).flat_map(|i| record(i, format, rgb)).collect();
    let record_bytes = records.len() / (SIDE * SIDE);
    let mut compressed = Cursor::new(Vec::new());
    laz::compress_buffer(&mut compressed, &records, laz.clone()).expect("compresses");
    // The position of the table of the chunks, the chunk, the table.
    let mut body = compressed.into_inner();
    let mut laz_vlr = Vec::new();
    laz.write_to(&mut laz_vlr).expect("a vector takes all");

    let points_at = HEADER + VLR + 160 + VLR + laz_vlr.len();
    let table_at = u64::from_le_bytes(body[..8].try_into().expect("8 bytes"));
    body[..8].copy_from_slice(&(table_at + points_at as u64).to_le_bytes());
    let hierarchy_at = (points_at + body.len() + EVLR) as u64;

    let mut file = header(format, (record_bytes, points_at), hierarchy_at - EVLR as u64);
    file.extend(vlr("copc", 1, 160));
    let half = SIDE as f64 * 0.1;
    for value in [half, half, half, half, half / 64.0] {
        file.extend(value.to_le_bytes());
    }
    file.extend(hierarchy_at.to_le_bytes());
    file.extend(32_u64.to_le_bytes());
    for time_s in [0.0, (SIDE * SIDE) as f64] {
        file.extend(f64::to_le_bytes(time_s));
    }
    file.resize(HEADER + VLR + 160, 0);
    file.extend(vlr("laszip encoded", 22_204, laz_vlr.len()));
    file.extend(laz_vlr);
    file.extend(&body);
    file.extend([0; 2]);
    file.extend(padded("copc", 16));
    file.extend(1000_u16.to_le_bytes());
    file.extend(32_u64.to_le_bytes());
    file.extend([0; 32]);
    // The root and its chunk, which starts after the position of the table.
    file.extend([0; 16]);
    file.extend((points_at as u64 + 8).to_le_bytes());
    file.extend((table_at as i32 - 8).to_le_bytes());
    file.extend(((SIDE * SIDE) as i32).to_le_bytes());
    std::fs::write(path, file).expect("writes");
}

fn record(i: usize, format: u8, rgb: [u16; 3]) -> Vec<u8> {
    let x = i % SIDE * 20;
    let y = i / SIDE * 20;
    let (z, class) = if i < SIDE * SIDE / 2 { (0, 2) } else { (300, 6) };
    let mut bytes: Vec<u8> = [x as i32, y as i32, z].into_iter().flat_map(i32::to_le_bytes).collect();
    // Intensity; return 1 of 1, flags, class, user data; scan angle, source.
    bytes.extend((i as u16).to_le_bytes());
    bytes.extend([0x11, 0, class, 0, 0, 0, 0, 0]);
    bytes.extend((i as f64).to_le_bytes());
    if format >= 7 {
        bytes.extend(rgb.into_iter().flat_map(u16::to_le_bytes));
    }
    if format == 8 {
        // Near infrared.
        bytes.extend(1000_u16.to_le_bytes());
    }
    bytes
}

fn header(format: u8, (record_bytes, points_at): (usize, usize), evlr_at: u64) -> Vec<u8> {
    let n_points = (SIDE * SIDE) as u64;
    let mut bytes = b"LASF\0\0\x10\0".to_vec();
    bytes.resize(24, 0);
    bytes.extend([1, 4]);
    bytes.extend(padded("another program", 64));
    bytes.extend([0; 4]);
    bytes.extend((HEADER as u16).to_le_bytes());
    bytes.extend((points_at as u32).to_le_bytes());
    bytes.extend(2_u32.to_le_bytes());
    bytes.push(format | 0x80);
    bytes.extend((record_bytes as u16).to_le_bytes());
    bytes.resize(131, 0);
    let high_m = (SIDE - 1) as f64 * 0.2;
    let top_m = 3.0;
    let numbers = [SCALE_M, SCALE_M, SCALE_M, 0.0, 0.0, 0.0, high_m, 0.0, high_m, 0.0, top_m, 0.0];
    bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
    bytes.extend([0; 8]);
    bytes.extend(evlr_at.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(n_points.to_le_bytes());
    bytes.extend(n_points.to_le_bytes());
    bytes.resize(HEADER, 0);
    bytes
}

fn vlr(user: &str, id: u16, n_bytes: usize) -> Vec<u8> {
    let mut bytes = vec![0; 2];
    bytes.extend(padded(user, 16));
    bytes.extend(id.to_le_bytes());
    bytes.extend((n_bytes as u16).to_le_bytes());
    bytes.resize(VLR, 0);
    bytes
}

fn padded(text: &str, n_bytes: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(n_bytes, 0);
    bytes
}
