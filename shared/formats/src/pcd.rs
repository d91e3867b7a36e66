//! PCD 0.5 to 0.7 point clouds (Point Cloud Library): a text header, then ASCII, binary or compressed rows.
//!
//! Read: coordinates, intensities, rings and times by the names of [`Field`], of any scalar type, in all three encodings. Other
//! fields are ignored. Written: binary, `x y z intensity` as f32, `ring` as u16, `t` as u32.
//!
//! Not based on a crate: the reader is small, bounded, and tested with damaged input.

mod error;
mod header;
mod lzf;

pub use error::{PcdError, PcdFault};
pub use lzf::LzfFault;

use crate::cloud::{CloudPoint, FiredCloud, FiredPoint};
use crate::cloud_fields::{Column, Field, PointFlags, RawCloud, ValueType, number};
use header::{Encoding, Header, N_WANTED};
use std::borrow::Cow;

/// Points of a compressed file for each of its bytes, beyond a fixed number: real clouds have less than one, but missing returns
/// need almost no bytes.
const MAX_POINTS_PER_BYTE: usize = 2;
/// Bytes after the rows of a binary file: some writers fill the last page of memory.
const MAX_PADDING: usize = 65_536;
/// Points of a compressed file that need no bytes.
const FREE_POINTS: usize = 300_000;

/// The points of a file, without rings and times.
pub fn points_from_pcd(bytes: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let cloud = raw_from_pcd(bytes)?;
    let intensity = |index: usize| cloud.intensities.as_ref().map_or(0.0, |column| column.values[index]) as f32;
    let point = |(index, [x, y, z]): (usize, &[f64; 3])| CloudPoint {
        x: *x as f32,
        y: *y as f32,
        z: *z as f32,
        intensity: intensity(index),
    };
    Ok(cloud.positions.iter().enumerate().map(point).collect())
}

/// The points of a file as columns.
pub fn raw_from_pcd(bytes: &[u8]) -> Result<RawCloud, PcdError> {
    let header = Header::parse(bytes)?;
    let data = bytes.get(header.n_bytes..).unwrap_or_default();
    let mut columns = Columns::new(&header);
    match header.encoding {
        Encoding::Ascii => ascii(&header, data, &mut columns)?,
        Encoding::Binary => {
            for row in plain(&header, data)?.chunks_exact(header.row_bytes.max(1)) {
                columns.push(header.values.map(|value| value.map_or(0.0, |value| value.decode(row, value.offset))));
            }
        }
        Encoding::Compressed => {
            let data = decompressed(&header, data)?;
            // One block for each field.
            for index in 0..header.n_points {
                let at = |value: header::Value| header.n_points * value.offset + index * value.stride;
                columns.push(header.values.map(|value| value.map_or(0.0, |value| value.decode(&data, at(value)))));
            }
        }
    }
    Ok(columns.cloud(&header))
}

/// Content of a binary file with these points.
pub fn pcd_from_points(points: &[CloudPoint]) -> Vec<u8> {
    let points = points.iter().map(|point| FiredPoint { point: *point, ..FiredPoint::default() }).collect();
    pcd_from_cloud(&FiredCloud { points, has_rings: false, has_times: false })
}

/// Content of a binary file with this cloud.
pub fn pcd_from_cloud(cloud: &FiredCloud) -> Vec<u8> {
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

/// Values of the wanted fields.
struct Columns {
    positions: Vec<[f64; 3]>,
    /// Values of the fields after the coordinates; empty for absent ones.
    others: [Vec<f64>; N_WANTED - 3],
    is_present: [bool; N_WANTED - 3],
}

impl Columns {
    fn new(header: &Header) -> Self {
        let is_present = [3, 4, 5].map(|index| header.values[index].is_some());
        Self { positions: Vec::new(), others: Default::default(), is_present }
    }

    fn push(&mut self, [x, y, z, others @ ..]: [f64; N_WANTED]) {
        self.positions.push([x, y, z]);
        for ((column, value), is_present) in self.others.iter_mut().zip(others).zip(self.is_present) {
            if is_present {
                column.push(value);
            }
        }
    }

    fn cloud(self, header: &Header) -> RawCloud {
        let [intensities, beams, times] = self.others;
        let column = |field: Field, values: Vec<f64>| {
            let value = header.values[field as usize]?;
            Some(Column { name: header.names[field as usize].clone(), value_type: value.value_type, values })
        };
        let positions = header.values.iter().flatten().take(3).map(|value| value.value_type);
        RawCloud {
            positions: self.positions,
            // Integers and doubles are exact.
            position_type: positions.reduce(|a, b| if b == ValueType::F32 { b } else { a }).unwrap_or(ValueType::F32),
            intensities: column(Field::Intensity, intensities),
            beams: column(Field::Ring, beams),
            times: column(Field::Time, times),
            viewpoint: header.viewpoint.clone(),
            flags: PointFlags::default(),
        }
    }
}

/// The rows of a binary file.
fn plain<'a>(header: &Header, data: &'a [u8]) -> Result<&'a [u8], PcdError> {
    let expected = header.n_points.checked_mul(header.row_bytes);
    let Header { n_points, row_bytes, .. } = *header;
    let found = data.len();
    let Some(rows) = expected.and_then(|expected| data.get(..expected)) else {
        return Err(header.error(PcdFault::BinaryTruncated { n_points, row_bytes, found }));
    };
    if found - rows.len() > MAX_PADDING {
        return Err(header.error(PcdFault::BinaryLonger { n_points, row_bytes, found }));
    }
    Ok(rows)
}

/// The blocks of a compressed file.
fn decompressed(header: &Header, data: &[u8]) -> Result<Vec<u8>, PcdError> {
    let size =
        |at: usize| data.get(at..at + 4).and_then(|bytes| bytes.first_chunk()).map(|b| u32::from_le_bytes(*b) as usize);
    let (Some(n_packed), Some(n)) = (size(0), size(4)) else {
        return Err(header.error(PcdFault::Lzf(LzfFault::Truncated)));
    };
    let Header { n_points, row_bytes, .. } = *header;
    if n_points.checked_mul(row_bytes) != Some(n) {
        return Err(header.error(PcdFault::CompressedLength { n_points, row_bytes, found: n }));
    }
    let packed = data.get(8..).and_then(|packed| packed.get(..n_packed));
    let packed = packed.ok_or_else(|| {
        let found = data.len().saturating_sub(8);
        header.error(PcdFault::CompressedTruncated { declared: n_packed, found })
    })?;
    let limit = packed.len().saturating_mul(MAX_POINTS_PER_BYTE).saturating_add(FREE_POINTS);
    if n_points > limit {
        return Err(header.error(PcdFault::TooCompressed { n_points, n_bytes: packed.len() }));
    }
    lzf::decompress(packed, n).map_err(|fault| header.error(PcdFault::Lzf(fault)))
}

fn ascii(header: &Header, data: &[u8], columns: &mut Columns) -> Result<(), PcdError> {
    let mut n_found = 0;
    for (index, line) in data.split(|byte| matches!(byte, b'\n')).enumerate() {
        let error = |fault: PcdFault| PcdError { line: header.n_lines + index + 1, fault };
        // Invalid numbers of other systems may have letters of another encoding.
        let text: Cow<'_, str> = String::from_utf8_lossy(line);
        let mut words = text.split_ascii_whitespace();
        if words.clone().next().is_none() {
            continue;
        }
        if n_found == header.n_points {
            return Err(error(PcdFault::AsciiLonger { n_points: header.n_points }));
        }
        let mut numbers = [0.0; N_WANTED];
        for word_index in 0..header.row_words {
            let too_few = PcdFault::TooFewValues { found: word_index, expected: header.row_words };
            let word = words.next().ok_or_else(|| error(too_few))?;
            for (place, value) in numbers.iter_mut().zip(&header.values) {
                if value.is_some_and(|value| value.word == word_index) {
                    *place = number(word).ok_or_else(|| error(PcdFault::Number(word.to_owned())))?;
                }
            }
        }
        columns.push(numbers);
        n_found += 1;
    }
    if n_found < header.n_points {
        return Err(header.error(PcdFault::AsciiTruncated { n_points: header.n_points, found: n_found }));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud_fields::FormBuilder;

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
    fn padding_without_bytes_is_refused() {
        let header = "VERSION 0.7\nFIELDS x y z _ intensity _ ring\nSIZE 4 4 4 1 4 1 2\nTYPE F F F U F U U\nCOUNT 1 1 1 4 1 0 1\nWIDTH 1\n\
                      HEIGHT 1\nDATA binary\n";
        let error = points_from_pcd(&[header.as_bytes(), &[0; 22]].concat()).expect_err("is refused").to_string();
        assert!(error.contains("COUNT 0 of padding `_` before field \"ring\""), "{error}");
    }

    /// The points of a drive's only file.
    fn fired(bytes: &[u8]) -> Result<FiredCloud, String> {
        let cloud = raw_from_pcd(bytes).map_err(|error| error.to_string())?;
        let mut builder = FormBuilder::for_drive(None, None);
        builder.add(&cloud, Some(0)).map_err(|error| error.to_string())?;
        builder.finish().fired(&cloud, 0).map_err(|error| error.to_string())
    }

    #[test]
    fn rings_and_times_survive_round_trip() {
        let one =
            |i: u8| FiredPoint { point: points()[usize::from(i)], ring: i, offset_nanos: u32::from(i) * 1_999_999 };
        let cloud = FiredCloud { points: (0..50).map(one).collect(), has_rings: true, has_times: true };
        let bytes = pcd_from_cloud(&cloud);
        assert_eq!(fired(&bytes), Ok(cloud.clone()));
        assert_eq!(points_from_pcd(&bytes), Ok(points()));
        let bare = fired(&pcd_from_points(&points())).expect("reads");
        assert!(!bare.has_rings && !bare.has_times && bare.points[49].point == points()[49]);
    }

    #[test]
    fn times_in_seconds_and_faults_of_times_and_rings_are_read() {
        let head = "VERSION 0.7\nFIELDS x y z time ring\nSIZE 4 4 4 4 1\nTYPE F F F F U\nPOINTS 2\nDATA ascii\n";
        let read = |rows: &str| fired(format!("{head}{rows}").as_bytes());
        let cloud = read("1 2 3 0.0125 7\n1 2 3 0 63\n").expect("reads");
        let found: Vec<(u8, u32)> = cloud.points.iter().map(|p| (p.ring, p.offset_nanos)).collect();
        assert!(cloud.has_times && cloud.has_rings && found == [(7, 12_500_000), (63, 0)], "{found:?}");
        for (rows, rule) in [
            ("1 2 3 0 0\n1 2 3 5 0\n", "point 1: time 5 must be a time after"),
            ("1 2 3 nan 0\n1 2 3 0 0\n", "point 0: time NaN"),
            ("1 2 3 0 256\n1 2 3 0 0\n", "ring 256 must be a whole number"),
            ("1 2 3 0 0.5\n1 2 3 0 0\n", "ring 0.5"),
        ] {
            let error = read(rows).expect_err(rule);
            assert!(error.contains(rule), "{error}");
        }
        // A missing return needs neither ring nor time.
        assert_eq!(read("1 2 3 0.05 0\nnan nan nan nan nan\n").map(|cloud| cloud.points.len()), Ok(2));
    }

    #[test]
    fn compressed_file_has_the_points_of_the_binary_one() {
        let cloud = FiredCloud {
            points: points().into_iter().map(|point| FiredPoint { point, ring: 3, offset_nanos: 9 }).collect(),
            has_rings: true,
            has_times: true,
        };
        let binary = pcd_from_cloud(&cloud);
        let compressed = compressed(&binary, 22);
        assert_eq!(raw_from_pcd(&compressed), raw_from_pcd(&binary));
        for (file, rule) in [
            (compressed[..compressed.len() - 1].to_vec(), "bytes of compressed data are declared"),
            (with_word(&compressed, 4, 7), "50 points of 22 bytes are declared; the compressed data holds 7 bytes"),
            (with_word(&compressed, 0, 3), "the compressed data"),
        ] {
            let error = raw_from_pcd(&file).expect_err(rule).to_string();
            assert!(error.contains(rule), "{error}");
        }
        let n = u32::MAX / 16;
        let bomb = [
            format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS {n}\nDATA binary_compressed\n").into_bytes(),
            8_u32.to_le_bytes().to_vec(),
            (12 * n).to_le_bytes().to_vec(),
            vec![255; 8],
        ]
        .concat();
        let error = raw_from_pcd(&bomb).expect_err("is a bomb").to_string();
        assert!(error.contains("8 bytes of compressed data: no cloud is so small"), "{error}");
    }

    /// A binary file as a compressed one, with runs only.
    fn compressed(binary: &[u8], row_bytes: usize) -> Vec<u8> {
        let end = binary.windows(12).position(|part| part == b"DATA binary\n").expect("is there") + 12;
        let sizes = [4, 4, 4, 4, 2, 4];
        let mut blocks = Vec::new();
        for (index, size) in sizes.iter().enumerate() {
            let at: usize = sizes[..index].iter().sum();
            blocks.extend(binary[end..].chunks(row_bytes).flat_map(|row| &row[at..at + size]));
        }
        let runs = blocks.chunks(32).flat_map(|run| std::iter::once(run.len() as u8 - 1).chain(run.iter().copied()));
        let packed: Vec<u8> = runs.collect();
        let head = [&binary[..end - 1], b"_compressed\n"].concat();
        let sizes = [packed.len() as u32, blocks.len() as u32].map(u32::to_le_bytes).concat();
        [head, sizes, packed].concat()
    }

    /// The compressed file with a number after its header replaced.
    fn with_word(compressed: &[u8], at: usize, word: u32) -> Vec<u8> {
        let end = compressed.windows(12).position(|part| part == b"_compressed\n").expect("is there") + 12;
        let mut file = compressed.to_vec();
        file[end + at..end + at + 4].copy_from_slice(&word.to_le_bytes());
        file
    }

    #[test]
    fn faults_are_reported_with_their_line() {
        let good = String::from_utf8(pcd_from_points(&[])).expect("is text");
        for (from, to, line, rule) in [
            ("DATA binary", "DATA zip", 11, "expected ascii, binary or binary_compressed"),
            ("POINTS 0", "POINTS 3", 11, "POINTS 3, but WIDTH 0 times HEIGHT 1"),
            ("FIELDS x y z intensity", "FIELDS x y z x", 11, "field x occurs twice"),
            ("FIELDS x y z", "FIELDS x q z", 11, "no field y"),
            ("SIZE 4 4", "SIZE 3 4", 11, "F of 3 bytes"),
            ("SIZE 4 4", "SIZE 4", 11, "4 FIELDS, 3 SIZE"),
            ("POINTS 0", "POINTS -1", 10, "not a number of points"),
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
