//! The text header.

use super::error::{PcdError, PcdFault};
use crate::cloud_fields::{Field, ValueType};

/// Longest header that is read, lines. Real headers have about a dozen.
const MAX_HEADER_LINES: usize = 64;
/// Most values of a row, over all fields and counts.
const MAX_ROW_VALUES: usize = 4096;
/// Number of the fields that are read.
pub(super) const N_WANTED: usize = Field::ALL.len();

/// Encoding of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    /// One block for each field, compressed as one.
    Compressed,
}

/// Type and position of a value in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Value {
    pub(super) value_type: ValueType,
    /// Offset in a binary row.
    pub(super) offset: usize,
    /// Bytes of the field in a binary row: more than of the value if it is the first of several.
    pub(super) stride: usize,
    /// Index of the word in an ASCII row.
    pub(super) word: usize,
}

#[derive(Debug)]
pub(super) struct Header {
    /// Values in the order of [`Field::ALL`]. x y z are present.
    pub(super) values: [Option<Value>; N_WANTED],
    /// Names of the values; empty for absent ones.
    pub(super) names: [String; N_WANTED],
    pub(super) row_bytes: usize,
    pub(super) row_words: usize,
    pub(super) n_points: usize,
    pub(super) encoding: Encoding,
    /// The line `VIEWPOINT`; `None` for the identity.
    pub(super) viewpoint: Option<String>,
    /// Lines of the header.
    pub(super) n_lines: usize,
    /// Bytes of the header.
    pub(super) n_bytes: usize,
}

/// Positions of the values in a row.
#[derive(Default)]
struct RowLayout {
    values: [Option<Value>; N_WANTED],
    names: [String; N_WANTED],
    row_bytes: usize,
    row_words: usize,
}

impl Value {
    /// The value at this offset. [`Header::parse`] ensures that it lies inside the row.
    pub(super) fn decode(self, bytes: &[u8], at: usize) -> f64 {
        self.value_type.decode(bytes.get(at..).unwrap_or_default(), false)
    }
}

impl Header {
    /// An error of the data: at the last line of the header.
    pub(super) fn error(&self, fault: PcdFault) -> PcdError {
        PcdError { line: self.n_lines, fault }
    }

    pub(super) fn parse(bytes: &[u8]) -> Result<Self, PcdError> {
        let mut fields = Vec::new();
        let mut sizes = Vec::new();
        let mut kinds = Vec::new();
        let mut counts = Vec::new();
        let mut width = None;
        let mut height = None;
        let mut n_points = None;
        let mut viewpoint = None;
        let mut at = 0;
        for line in 1..=MAX_HEADER_LINES {
            let error = |fault: PcdFault| PcdError { line, fault };
            let rest = bytes.get(at..).unwrap_or_default();
            let length = rest.iter().position(|byte| *byte == b'\n');
            let length = length.ok_or_else(|| error(PcdFault::HeaderTruncated))?;
            let text = match std::str::from_utf8(&rest[..length]) {
                Ok(text) => text,
                // Comments have any encoding.
                Err(_) if rest.starts_with(b"#") => "",
                Err(_) => return Err(error(PcdFault::NotText)),
            };
            at += length + 1;
            let mut words = text.split_ascii_whitespace();
            let keyword = words.next().unwrap_or_default();
            let words: Vec<&str> = words.take(MAX_ROW_VALUES).collect();
            let count = || {
                let word = words.first().and_then(|word| word.parse::<usize>().ok());
                let keyword = keyword.to_owned();
                let found = words.join(" ");
                word.ok_or_else(|| error(PcdFault::Count { keyword, found }))
            };
            match keyword {
                "FIELDS" | "COLUMNS" => fields = words.iter().map(|word| (*word).to_owned()).collect(),
                "SIZE" => sizes = integers(&words).map_err(error)?,
                "COUNT" => counts = integers(&words).map_err(error)?,
                "TYPE" => kinds = words.iter().map(|word| (*word).to_owned()).collect(),
                "WIDTH" => width = Some(count()?),
                "HEIGHT" => height = Some(count()?),
                "VIEWPOINT" => viewpoint = (!is_identity(&words)).then(|| format!("VIEWPOINT {}", words.join(" "))),
                "POINTS" => n_points = Some(count()?),
                "DATA" => {
                    let encoding = match words.first() {
                        Some(&"binary") => Encoding::Binary,
                        Some(&"ascii") => Encoding::Ascii,
                        Some(&"binary_compressed") => Encoding::Compressed,
                        other => {
                            return Err(error(PcdFault::Encoding(other.copied().unwrap_or_default().to_owned())));
                        }
                    };
                    let size = width.zip(height);
                    if let (Some(n_points), Some((width, height))) = (n_points, size)
                        && usize::checked_mul(width, height) != Some(n_points)
                    {
                        return Err(error(PcdFault::Size { n_points, width, height }));
                    }
                    let n_points = n_points.or(size.and_then(|(width, height)| width.checked_mul(height)));
                    let n_points = n_points.ok_or_else(|| error(PcdFault::NoCount))?;
                    let RowLayout { values, names, row_bytes, row_words } =
                        layout(&fields, &sizes, &kinds, &counts).map_err(error)?;
                    let n_lines = line;
                    let n_bytes = at;
                    return Ok(Self {
                        values,
                        names,
                        row_bytes,
                        row_words,
                        n_points,
                        encoding,
                        viewpoint,
                        n_lines,
                        n_bytes,
                    });
                }
                // VERSION, comments and unknown keywords are ignored.
                _ => {}
            }
        }
        Err(PcdError { line: MAX_HEADER_LINES, fault: PcdFault::NoData })
    }
}

/// Whether a viewpoint (x y z and a quaternion w x y z) is the origin without a rotation. Some writers leave all numbers 0.
fn is_identity(words: &[&str]) -> bool {
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    numbers.is_some_and(|numbers| numbers.iter().enumerate().all(|(index, number)| index == 3 || *number == 0.0))
}

fn integers(words: &[&str]) -> Result<Vec<usize>, PcdFault> {
    let integer = |word: &&str| {
        let number = word.parse::<usize>().ok().filter(|number| *number <= MAX_ROW_VALUES);
        number.ok_or_else(|| PcdFault::Integer { found: (*word).to_owned(), limit: MAX_ROW_VALUES })
    };
    words.iter().map(integer).collect()
}

fn layout(fields: &[String], sizes: &[usize], kinds: &[String], counts: &[usize]) -> Result<RowLayout, PcdFault> {
    if sizes.len() != fields.len()
        || kinds.len() != fields.len()
        || !(counts.is_empty() || counts.len() == fields.len())
    {
        let fields = fields.len();
        let sizes = sizes.len();
        let types = kinds.len();
        let counts = counts.len();
        return Err(PcdFault::Lists { fields, sizes, types, counts });
    }
    let mut found = RowLayout::default();
    let mut all = Vec::new();
    for (index, field) in fields.iter().enumerate() {
        let size = sizes[index];
        let count = counts.get(index).copied().unwrap_or(1);
        let value_type = value_type(&kinds[index], size);
        let value_type =
            value_type.ok_or_else(|| PcdFault::Type { field: field.clone(), kind: kinds[index].clone(), size })?;
        // Padding of zero bytes has been seen where there were bytes: the fields after it would be read from wrong places.
        if field == "_" && count == 0 {
            return Err(PcdFault::EmptyPadding { before: fields.get(index + 1).cloned().unwrap_or_default() });
        }
        // Other fields without values have no place in a row.
        let name = if count == 0 { "" } else { field.as_str() };
        all.push((name, Value { value_type, offset: found.row_bytes, stride: size * count, word: found.row_words }));
        found.row_bytes += size * count;
        found.row_words += count;
    }
    if found.row_words > MAX_ROW_VALUES {
        return Err(PcdFault::RowLength { found: found.row_words, limit: MAX_ROW_VALUES });
    }
    let names = || all.iter().map(|(name, _)| *name);
    for field in Field::ALL {
        let Some(index) = field.find(&names()) else { continue };
        if names().filter(|name| *name == all[index].0).count() > 1 {
            return Err(PcdFault::Twice(all[index].0.to_owned()));
        }
        found.values[field as usize] = Some(all[index].1);
        all[index].0.clone_into(&mut found.names[field as usize]);
    }
    match found.values[..3].iter().position(Option::is_none) {
        None => Ok(found),
        Some(missing) => Err(PcdFault::MissingField(Field::ALL[missing].names()[0])),
    }
}

fn value_type(kind: &str, size: usize) -> Option<ValueType> {
    Some(match (kind.bytes().next()?, size) {
        (b'F', 4) => ValueType::F32,
        (b'F', 8) => ValueType::F64,
        (b'I', 1) => ValueType::I8,
        (b'I', 2) => ValueType::I16,
        (b'I', 4) => ValueType::I32,
        (b'I', 8) => ValueType::I64,
        (b'U', 1) => ValueType::U8,
        (b'U', 2) => ValueType::U16,
        (b'U', 4) => ValueType::U32,
        (b'U', 8) => ValueType::U64,
        _ => return None,
    })
}
