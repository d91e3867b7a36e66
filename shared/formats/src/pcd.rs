//! PCD 0.7 point clouds (Point Cloud Library): a text header, then ASCII or binary rows.
//!
//! Read: fields `x y z` and, if there, `intensity` (any scalar type; other fields are passed over), ASCII and binary.
//! Compressed ones are refused by name. Written: binary, `x y z intensity` as f32.

use crate::cloud::CloudPoint;

/// Why bytes are no cloud.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("line {line}: {rule}")]
pub struct PcdError {
    /// Counted from 1; in binary data, that of the header's last line.
    pub line: usize,
    /// What was found and what must be there.
    pub rule: String,
}

/// What the longest header of a real file is far below.
const MAX_HEADER_LINES: usize = 64;
/// Values of one row, over all fields and their counts.
const MAX_ROW_VALUES: usize = 4096;
/// In the order of [`CloudPoint`].
const WANTED: [&str; 4] = ["x", "y", "z", "intensity"];

/// Type and place of a value in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Value {
    kind: u8,
    size: usize,
    /// Byte in a binary row.
    offset: usize,
    /// Word in an ASCII row.
    word: usize,
}

#[derive(Debug)]
struct Header {
    /// By [`WANTED`]; x y z are there.
    values: [Option<Value>; 4],
    row_bytes: usize,
    row_words: usize,
    n_points: usize,
    is_binary: bool,
    n_lines: usize,
    n_bytes: usize,
}

/// The points of a file.
pub fn points_from_pcd(bytes: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let header = Header::parse(bytes)?;
    let data = bytes.get(header.n_bytes..).unwrap_or_default();
    if header.is_binary { binary(&header, data) } else { ascii(&header, data) }
}

/// A binary file with these points.
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
        let (n, row, got) = (header.n_points, header.row_bytes, data.len());
        let rule = format!("{n} points of {row} bytes are promised, {got} bytes follow");
        return Err(PcdError { line: header.n_lines, rule });
    };
    let rows = data.chunks_exact(header.row_bytes);
    let point = |row: &[u8]| point(header.values.map(|value| value.map_or(0.0, |value| value.decode(row))));
    Ok(rows.map(point).collect())
}

fn ascii(header: &Header, data: &[u8]) -> Result<Vec<CloudPoint>, PcdError> {
    let mut points = Vec::new();
    for (index, line) in data.split(|byte| *byte == b'\n').enumerate() {
        let line_number = header.n_lines + index + 1;
        let fault = |rule: String| PcdError { line: line_number, rule };
        let text = std::str::from_utf8(line).map_err(|_| fault("is no text".into()))?;
        let mut words = text.split_ascii_whitespace();
        if words.clone().next().is_none() || points.len() == header.n_points {
            continue;
        }
        let mut numbers = [0.0; 4];
        for word_index in 0..header.row_words {
            let word =
                words.next().ok_or_else(|| fault(format!("{word_index} values, must be {}", header.row_words)))?;
            for (number, value) in numbers.iter_mut().zip(&header.values) {
                if value.is_some_and(|value| value.word == word_index) {
                    *number = word.parse().map_err(|_| fault(format!("{word:?} is no number")))?;
                }
            }
        }
        points.push(point(numbers));
    }
    if points.len() < header.n_points {
        let rule = format!("{} points are promised, {} are there", header.n_points, points.len());
        return Err(PcdError { line: header.n_lines, rule });
    }
    Ok(points)
}

fn point([x, y, z, intensity]: [f32; 4]) -> CloudPoint {
    CloudPoint { x, y, z, intensity }
}

impl Value {
    /// Its bytes are inside the row, which [`Header::parse`] saw to.
    fn decode(self, row: &[u8]) -> f32 {
        let bytes = &row[self.offset..self.offset + self.size];
        let mut wide = [0; 8];
        wide[..self.size].copy_from_slice(bytes);
        let unsigned = u64::from_le_bytes(wide);
        let unused_bits = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'F', 4) => f32::from_bits(unsigned as u32),
            (b'F', _) => f64::from_bits(unsigned) as f32,
            (b'I', _) => ((unsigned << unused_bits) as i64 >> unused_bits) as f32,
            _ => unsigned as f32,
        }
    }
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, PcdError> {
        let (mut fields, mut sizes, mut kinds, mut counts) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut width, mut height, mut n_points) = (None, None, None);
        let mut at = 0;
        for line in 1..=MAX_HEADER_LINES {
            let fault = |rule: String| PcdError { line, rule };
            let rest = bytes.get(at..).unwrap_or_default();
            let length =
                rest.iter().position(|byte| *byte == b'\n').ok_or_else(|| fault("the header is cut".into()))?;
            let text = std::str::from_utf8(&rest[..length]).map_err(|_| fault("is no text".into()))?;
            at += length + 1;
            let mut words = text.split_ascii_whitespace();
            let keyword = words.next().unwrap_or_default();
            let words: Vec<&str> = words.take(MAX_ROW_VALUES).collect();
            let count = || {
                let word = words.first().and_then(|word| word.parse::<usize>().ok());
                word.ok_or_else(|| fault(format!("{keyword} {:?} must be a count", words.join(" "))))
            };
            match keyword {
                "FIELDS" => fields = words.iter().map(|word| (*word).to_owned()).collect(),
                "SIZE" => sizes = numbers(&words).map_err(fault)?,
                "COUNT" => counts = numbers(&words).map_err(fault)?,
                "TYPE" => kinds = words.iter().map(|word| (*word).to_owned()).collect(),
                "WIDTH" => width = Some(count()?),
                "HEIGHT" => height = Some(count()?),
                "POINTS" => n_points = Some(count()?),
                "DATA" => {
                    let is_binary = match words.first() {
                        Some(&"binary") => true,
                        Some(&"ascii") => false,
                        other => return Err(fault(format!("DATA {other:?} must be ascii or binary"))),
                    };
                    let n_points = n_points.or(width.zip(height).and_then(|(w, h)| w.checked_mul(h)));
                    let n_points =
                        n_points.ok_or_else(|| fault("neither POINTS nor WIDTH and HEIGHT stand above".into()))?;
                    let (values, row_bytes, row_words) = layout(&fields, &sizes, &kinds, &counts).map_err(fault)?;
                    return Ok(Self { values, row_bytes, row_words, n_points, is_binary, n_lines: line, n_bytes: at });
                }
                // VERSION, VIEWPOINT, comments and whatever a later version brings.
                _ => {}
            }
        }
        Err(PcdError { line: MAX_HEADER_LINES, rule: "no DATA line so far".into() })
    }
}

fn numbers(words: &[&str]) -> Result<Vec<usize>, String> {
    let number = |word: &&str| {
        let number = word.parse::<usize>().ok().filter(|number| *number <= MAX_ROW_VALUES);
        number.ok_or_else(|| format!("{word:?} must be a number up to {MAX_ROW_VALUES}"))
    };
    words.iter().map(number).collect()
}

/// Where the wanted values are, bytes and words of a row.
fn layout(
    fields: &[String],
    sizes: &[usize],
    kinds: &[String],
    counts: &[usize],
) -> Result<([Option<Value>; 4], usize, usize), String> {
    if sizes.len() != fields.len()
        || kinds.len() != fields.len()
        || !(counts.is_empty() || counts.len() == fields.len())
    {
        return Err(format!(
            "{} FIELDS, {} SIZE, {} TYPE, {} COUNT: must be as many of each",
            fields.len(),
            sizes.len(),
            kinds.len(),
            counts.len()
        ));
    }
    let (mut values, mut row_bytes, mut row_words) = ([None; 4], 0, 0);
    for (index, field) in fields.iter().enumerate() {
        let (size, count) = (sizes[index], counts.get(index).copied().unwrap_or(1));
        let kind = kinds[index].bytes().next().unwrap_or_default();
        let is_known = match kind {
            b'F' => matches!(size, 4 | 8),
            b'I' | b'U' => matches!(size, 1 | 2 | 4 | 8),
            _ => false,
        };
        if !is_known {
            return Err(format!(
                "field {field}: type {} of {size} bytes is none of F4 F8 I1 I2 I4 I8 U1 U2 U4 U8",
                kinds[index]
            ));
        }
        if let Some(place) = WANTED.iter().position(|wanted| wanted == field)
            && count > 0
        {
            values[place] = Some(Value { kind, size, offset: row_bytes, word: row_words });
        }
        row_bytes += size * count;
        row_words += count;
    }
    if row_words > MAX_ROW_VALUES {
        return Err(format!("{row_words} values a row, must be at most {MAX_ROW_VALUES}"));
    }
    match values[..3].iter().position(Option::is_none) {
        None => Ok((values, row_bytes, row_words)),
        Some(missing) => Err(format!("no field {}", WANTED[missing])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<CloudPoint> {
        (0..50).map(|i| CloudPoint { x: 0.1 * i as f32, y: -3.0, z: 1.0 / 3.0, intensity: i as f32 }).collect()
    }

    #[test]
    fn binary_comes_back_to_the_bit() {
        let bytes = pcd_from_points(&points());
        assert_eq!(points_from_pcd(&bytes), Ok(points()));
        let cut = points_from_pcd(&bytes[..bytes.len() - 1]).expect_err("is cut");
        assert!(cut.rule.contains("50 points of 16 bytes"), "{cut}");
    }

    #[test]
    fn ascii_and_other_layouts_read() {
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
    fn faults_are_named() {
        let good = String::from_utf8(pcd_from_points(&[])).expect("is text");
        for (from, to, line, rule) in [
            ("DATA binary", "DATA binary_compressed", 11, "must be ascii or binary"),
            ("FIELDS x y z", "FIELDS x q z", 11, "no field y"),
            ("SIZE 4 4", "SIZE 3 4", 11, "F of 3 bytes"),
            ("SIZE 4 4", "SIZE 4", 11, "4 FIELDS, 3 SIZE"),
            ("POINTS 0", "POINTS -1", 10, "must be a count"),
            ("POINTS 0", "POINTS 9999999999999999", 11, "0 bytes follow"),
            ("DATA binary\n", "", 11, "header is cut"),
        ] {
            let error = points_from_pcd(good.replace(from, to).as_bytes()).expect_err(to);
            assert_eq!(error.line, line, "{to}: {error}");
            assert!(error.rule.contains(rule), "{to}: {error}");
        }
    }

    #[test]
    fn a_real_sweep_reads() {
        let Some(path) = real_data::real_data("kitti_raw_0048/0000000000.pcd") else { return };
        let points = points_from_pcd(&std::fs::read(path).expect("reads")).expect("decodes");
        assert_eq!(points.len(), 119_978);
        assert_eq!(points[0], CloudPoint { x: 52.301, y: 7.3, z: 1.995, intensity: 0.12 });
    }
}
