//! PCD 0.7 point clouds (Point Cloud Library): a text header, then ASCII or binary rows.
//!
//! Read: fields `x y z` and, if present, `intensity`, `ring`, and the time after the sweep's stamp as `t` in ns or `time` in s (any
//! scalar type), ASCII and binary. Other fields are ignored. Compressed data is refused. Written: binary, `x y z intensity` as f32,
//! `ring` as u16, `t` as u32.
//!
//! Not based on a crate: the reader is small, bounded, and tested with damaged input.

mod error;
mod header;

pub use error::{PcdError, PcdFault};

use crate::cloud::{CloudPoint, FiredPoint};
use header::{Header, N_WANTED};

/// Latest time of a point that is read, ns: below the range of u32.
const MAX_OFFSET_NANOS: f64 = 4e9;

/// The points of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PcdCloud {
    /// The points, in the order of the file.
    pub points: Vec<FiredPoint>,
    /// Whether the file has rings.
    pub has_rings: bool,
    /// Whether the file has times.
    pub has_times: bool,
}

/// The points of a file, without rings and times.
pub fn points_from_pcd(bytes: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let header = Header::parse(bytes)?;
    rows(&header, bytes, |numbers, _| Ok(point(numbers)))
}

/// The points of a file, with its rings and times, if present.
pub fn cloud_from_pcd(bytes: &[u8]) -> Result<PcdCloud, PcdError> {
    let header = Header::parse(bytes)?;
    let [_, _, _, _, ring, nanos, seconds] = header.values.map(|value| value.is_some());
    let points = rows(&header, bytes, |numbers, index| {
        let (at, found, field, unit) = match (nanos, seconds) {
            (true, _) => (numbers[5], numbers[5], "t", "ns"),
            (false, true) => ((numbers[6] * 1e9).round(), numbers[6], "time", "s"),
            (false, false) => (0.0, 0.0, "", ""),
        };
        if !(0.0..=MAX_OFFSET_NANOS).contains(&at) {
            return Err(PcdFault::Time { index, field, found, unit });
        }
        let found = numbers[4];
        if !(0.0..=255.0).contains(&found) || found.fract() != 0.0 {
            return Err(PcdFault::Ring { index, found });
        }
        Ok(FiredPoint { point: point(numbers), ring: found as u8, offset_nanos: at as u32 })
    })?;
    Ok(PcdCloud { points, has_rings: ring, has_times: nanos || seconds })
}

/// Content of a binary file with these points.
pub fn pcd_from_points(points: &[CloudPoint]) -> Vec<u8> {
    let points = points.iter().map(|point| FiredPoint { point: *point, ..FiredPoint::default() }).collect();
    pcd_from_cloud(&PcdCloud { points, has_rings: false, has_times: false })
}

/// Content of a binary file with this cloud.
pub fn pcd_from_cloud(cloud: &PcdCloud) -> Vec<u8> {
    let n = cloud.points.len();
    let optional = [(cloud.has_rings, [" ring", " 2", " U", " 1"]), (cloud.has_times, [" t", " 4", " U", " 1"])];
    let more =
        |line: usize| -> String { optional.iter().filter(|(has, _)| *has).map(|(_, words)| words[line]).collect() };
    let mut bytes = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity{}\nSIZE 4 4 4 4{}\nTYPE F F F F{}\n\
         COUNT 1 1 1 1{}\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n",
        more(0),
        more(1),
        more(2),
        more(3)
    )
    .into_bytes();
    for FiredPoint { point: p, ring, offset_nanos } in &cloud.points {
        bytes.extend([p.x, p.y, p.z, p.intensity].map(f32::to_le_bytes).as_flattened());
        if cloud.has_rings {
            bytes.extend(u16::from(*ring).to_le_bytes());
        }
        if cloud.has_times {
            bytes.extend(offset_nanos.to_le_bytes());
        }
    }
    bytes
}

/// Calls `row` with the values of each point and its index, and collects the results.
fn rows<T>(
    header: &Header,
    bytes: &[u8],
    row: impl Fn([f64; N_WANTED], usize) -> Result<T, PcdFault>,
) -> Result<Vec<T>, PcdError> {
    let data = bytes.get(header.n_bytes..).unwrap_or_default();
    if header.is_binary { binary(header, data, row) } else { ascii(header, data, row) }
}

fn binary<T>(
    header: &Header,
    data: &[u8],
    row: impl Fn([f64; N_WANTED], usize) -> Result<T, PcdFault>,
) -> Result<Vec<T>, PcdError> {
    let error = |fault: PcdFault| PcdError { line: header.n_lines, fault };
    let expected = header.n_points.checked_mul(header.row_bytes);
    let Some(data) = expected.and_then(|expected| data.get(..expected)) else {
        return Err(error(PcdFault::BinaryTruncated {
            n_points: header.n_points,
            row_bytes: header.row_bytes,
            found: data.len(),
        }));
    };
    let numbers = |bytes: &[u8]| header.values.map(|value| value.map_or(0.0, |value| value.decode(bytes)));
    let rows = data.chunks_exact(header.row_bytes).enumerate();
    rows.map(|(index, bytes)| row(numbers(bytes), index).map_err(error)).collect()
}

fn ascii<T>(
    header: &Header,
    data: &[u8],
    row: impl Fn([f64; N_WANTED], usize) -> Result<T, PcdFault>,
) -> Result<Vec<T>, PcdError> {
    let mut found = Vec::new();
    for (index, line) in data.split(|byte| *byte == b'\n').enumerate() {
        let line_number = header.n_lines + index + 1;
        let error = |fault: PcdFault| PcdError { line: line_number, fault };
        let text = std::str::from_utf8(line).map_err(|_| error(PcdFault::NotText))?;
        let mut words = text.split_ascii_whitespace();
        if words.clone().next().is_none() || found.len() == header.n_points {
            continue;
        }
        let mut numbers = [0.0; N_WANTED];
        for word_index in 0..header.row_words {
            let too_few = PcdFault::TooFewValues { found: word_index, expected: header.row_words };
            let word = words.next().ok_or_else(|| error(too_few))?;
            for (number, value) in numbers.iter_mut().zip(&header.values) {
                if value.is_some_and(|value| value.word == word_index) {
                    *number = word.parse().map_err(|_| error(PcdFault::Number(word.to_owned())))?;
                }
            }
        }
        found.push(row(numbers, found.len()).map_err(error)?);
    }
    if found.len() < header.n_points {
        let fault = PcdFault::AsciiTruncated { n_points: header.n_points, found: found.len() };
        return Err(PcdError { line: header.n_lines, fault });
    }
    Ok(found)
}

fn point([x, y, z, intensity, ..]: [f64; N_WANTED]) -> CloudPoint {
    CloudPoint { x: x as f32, y: y as f32, z: z as f32, intensity: intensity as f32 }
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
    fn rings_and_times_survive_round_trip() {
        let fired =
            |i: u8| FiredPoint { point: points()[usize::from(i)], ring: i, offset_nanos: u32::from(i) * 9_999_999 };
        let cloud = PcdCloud { points: (0..50).map(fired).collect(), has_rings: true, has_times: true };
        let bytes = pcd_from_cloud(&cloud);
        assert_eq!(cloud_from_pcd(&bytes), Ok(cloud.clone()));
        assert_eq!(points_from_pcd(&bytes), Ok(points()));
        let bare = cloud_from_pcd(&pcd_from_points(&points())).expect("reads");
        assert!(!bare.has_rings && !bare.has_times && bare.points[49].point == points()[49]);
    }

    #[test]
    fn times_in_seconds_and_faults_of_times_and_rings_are_read() {
        let head = "VERSION 0.7\nFIELDS x y z time ring\nSIZE 4 4 4 4 1\nTYPE F F F F U\nPOINTS 2\nDATA ascii\n";
        let read = |rows: &str| cloud_from_pcd(format!("{head}{rows}").as_bytes());
        let cloud = read("1 2 3 0.0125 7\n1 2 3 0 63\n").expect("reads");
        let found: Vec<(u8, u32)> = cloud.points.iter().map(|p| (p.ring, p.offset_nanos)).collect();
        assert!(cloud.has_times && cloud.has_rings && found == [(7, 12_500_000), (63, 0)], "{found:?}");
        for (rows, line, rule) in [
            ("1 2 3 0 0\n1 2 3 -0.1 0\n", 8, "point 1: time -0.1 must be a time after"),
            ("1 2 3 nan 0\n1 2 3 0 0\n", 7, "point 0: time NaN"),
            ("1 2 3 0 256\n1 2 3 0 0\n", 7, "ring 256 must be a whole number"),
            ("1 2 3 0 0.5\n1 2 3 0 0\n", 7, "ring 0.5"),
        ] {
            let error = read(rows).expect_err(rule);
            assert!(error.line == line && error.to_string().contains(rule), "{error}");
        }
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
