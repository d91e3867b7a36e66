//! PCD 0.7 point clouds (Point Cloud Library): a text header, then ASCII or binary rows.
//!
//! Read: fields `x y z` and, if present, `intensity` (any scalar type), ASCII and binary. Other fields are ignored. Compressed data is
//! refused. Written: binary, `x y z intensity` as f32.
//!
//! Written here: the reader is small, bounded, and tested against damaged input.

mod error;
mod header;

pub use error::{PcdError, PcdFault};

use crate::cloud::CloudPoint;
use header::Header;

/// The points of a file.
pub fn points_from_pcd(bytes: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let header = Header::parse(bytes)?;
    let data = bytes.get(header.n_bytes..).unwrap_or_default();
    if header.is_binary { binary(&header, data) } else { ascii(&header, data) }
}

/// Content of a binary file with these points.
pub fn pcd_from_points(points: &[CloudPoint]) -> Vec<u8> {
    let n = points.len();
    let mut bytes = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\n\
         COUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n"
    )
    .into_bytes();
    bytes.extend(points.iter().flat_map(|p| [p.x, p.y, p.z, p.intensity]).flat_map(f32::to_le_bytes));
    bytes
}

fn binary(header: &Header, data: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let expected = header.n_points.checked_mul(header.row_bytes);
    let Some(data) = expected.and_then(|expected| data.get(..expected)) else {
        let fault =
            PcdFault::BinaryTruncated { n_points: header.n_points, row_bytes: header.row_bytes, found: data.len() };
        return Err(PcdError { line: header.n_lines, fault });
    };
    let rows = data.chunks_exact(header.row_bytes);
    let point = |row: &[u8]| point(header.values.map(|value| value.map_or(0.0, |value| value.decode(row))));
    Ok(rows.map(point).collect())
}

fn ascii(header: &Header, data: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let mut points = Vec::new();
    for (index, line) in data.split(|byte| *byte == b'\n').enumerate() {
        let line_number = header.n_lines + index + 1;
        let error = |fault: PcdFault| PcdError { line: line_number, fault };
        let text = std::str::from_utf8(line).map_err(|_| error(PcdFault::NotText))?;
        let mut words = text.split_ascii_whitespace();
        if words.clone().next().is_none() || points.len() == header.n_points {
            continue;
        }
        let mut numbers = [0.0; 4];
        for word_index in 0..header.row_words {
            let too_few = PcdFault::TooFewValues { found: word_index, expected: header.row_words };
            let word = words.next().ok_or_else(|| error(too_few))?;
            for (number, value) in numbers.iter_mut().zip(&header.values) {
                if value.is_some_and(|value| value.word == word_index) {
                    *number = word.parse().map_err(|_| error(PcdFault::Number(word.to_owned())))?;
                }
            }
        }
        points.push(point(numbers));
    }
    if points.len() < header.n_points {
        let fault = PcdFault::AsciiTruncated { n_points: header.n_points, found: points.len() };
        return Err(PcdError { line: header.n_lines, fault });
    }
    Ok(points)
}

fn point([x, y, z, intensity]: [f32; 4]) -> CloudPoint {
    CloudPoint { x, y, z, intensity }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<CloudPoint> {
        (0..50).map(|i| CloudPoint { x: 0.1 * i as f32, y: -3.0, z: 1.0 / 3.0, intensity: i as f32 }).collect()
    }

    #[test]
    fn binary_survives_round_trip_bit_for_bit() {
        let bytes = pcd_from_points(&points());
        assert_eq!(points_from_pcd(&bytes), Ok(points()));
        let cut = points_from_pcd(&bytes[..bytes.len() - 1]).expect_err("is cut");
        assert!(cut.to_string().contains("50 points of 16 bytes"), "{cut}");
    }

    #[test]
    fn ascii_and_other_layouts_are_read() {
        let ascii = "VERSION 0.7\nFIELDS intensity rgb x y z\nSIZE 1 4 8 4 4\nTYPE U F F F F\nCOUNT 1 2 1 1 1\nWIDTH 2\nHEIGHT 1\n\
                     DATA ascii\n7 0 0 1.5 2 3\n\n255 9 9 -1.5 nan 0\n";
        let read = points_from_pcd(ascii.as_bytes()).expect("reads");
        assert_eq!(read[0], CloudPoint { x: 1.5, y: 2.0, z: 3.0, intensity: 7.0 });
        assert!(read[1].y.is_nan() && read[1].intensity == 255.0 && read.len() == 2);
        let mut binary = ascii[..ascii.find("ascii").expect("is there")].replace("TYPE U", "TYPE I").into_bytes();
        binary.extend(b"binary\n");
        for intensity in [-1_i8, 100] {
            binary.extend(intensity.to_le_bytes());
            binary.extend([0; 8]);
            binary.extend(1.5_f64.to_le_bytes());
            binary.extend([2.0_f32, 3.0].map(f32::to_le_bytes).concat());
        }
        let read = points_from_pcd(&binary).expect("reads");
        assert_eq!(read[0], CloudPoint { x: 1.5, y: 2.0, z: 3.0, intensity: -1.0 });
        assert_eq!(read[1].intensity, 100.0);
    }

    #[test]
    fn faults_are_reported_with_their_line() {
        let good = String::from_utf8(pcd_from_points(&[])).expect("is text");
        for (from, to, line, rule) in [
            ("DATA binary", "DATA binary_compressed", 11, "expected ascii or binary"),
            ("FIELDS x y z", "FIELDS x q z", 11, "no field y"),
            ("SIZE 4 4", "SIZE 3 4", 11, "F of 3 bytes"),
            ("SIZE 4 4", "SIZE 4", 11, "4 FIELDS, 3 SIZE"),
            ("POINTS 0", "POINTS -1", 10, "not a number of points"),
            ("POINTS 0", "POINTS 9999999999999999", 11, "0 bytes follow"),
            ("DATA binary\n", "", 11, "ends inside the header"),
        ] {
            let error = points_from_pcd(good.replace(from, to).as_bytes()).expect_err(to);
            assert_eq!(error.line, line, "{to}: {error}");
            assert!(error.to_string().contains(rule), "{to}: {error}");
        }
    }

    #[real_data::test("kitti_raw_0048/0000000000.pcd")]
    fn real_sweep_is_read() {
        let path = real_data::path("kitti_raw_0048/0000000000.pcd");
        let points = points_from_pcd(&std::fs::read(path).expect("reads")).expect("decodes");
        assert_eq!(points.len(), 119_978);
        assert_eq!(points[0], CloudPoint { x: 52.301, y: 7.3, z: 1.995, intensity: 0.12 });
    }
}
