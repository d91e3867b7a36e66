//! The text header.

use super::error::{PcdError, PcdFault};

/// Longest header that is read, lines. Real headers have about a dozen.
const MAX_HEADER_LINES: usize = 64;
/// Most values of a row, over all fields and counts.
const MAX_ROW_VALUES: usize = 4096;
/// Fields that are read.
const WANTED: [&str; N_WANTED] = ["x", "y", "z", "intensity", "ring", "t", "time"];
/// Number of the fields that are read.
pub(super) const N_WANTED: usize = 7;

/// Type and position of a value in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Value {
    kind: u8,
    size: usize,
    /// Offset in a binary row.
    offset: usize,
    /// Index of the word in an ASCII row.
    pub(super) word: usize,
}

#[derive(Debug)]
pub(super) struct Header {
    /// Values in the order of [`WANTED`]. x y z are present.
    pub(super) values: [Option<Value>; N_WANTED],
    pub(super) row_bytes: usize,
    pub(super) row_words: usize,
    pub(super) n_points: usize,
    pub(super) is_binary: bool,
    /// Lines of the header.
    pub(super) n_lines: usize,
    /// Bytes of the header.
    pub(super) n_bytes: usize,
}

impl Value {
    /// The value in a binary row. [`Header::parse`] ensures that it lies inside the row.
    pub(super) fn decode(self, row: &[u8]) -> f64 {
        let bytes = &row[self.offset..self.offset + self.size];
        let mut wide = [0; 8];
        wide[..self.size].copy_from_slice(bytes);
        let unsigned = u64::from_le_bytes(wide);
        let unused_bits = 64 - 8 * self.size as u32;
        match (self.kind, self.size) {
            (b'F', 4) => f64::from(f32::from_bits(unsigned as u32)),
            (b'F', _) => f64::from_bits(unsigned),
            (b'I', _) => ((unsigned << unused_bits) as i64 >> unused_bits) as f64,
            _ => unsigned as f64,
        }
    }
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, PcdError> {
        let mut fields = Vec::new();
        let mut sizes = Vec::new();
        let mut kinds = Vec::new();
        let mut counts = Vec::new();
        let mut width = None;
        let mut height = None;
        let mut n_points = None;
        let mut at = 0;
        for line in 1..=MAX_HEADER_LINES {
            let error = |fault: PcdFault| PcdError { line, fault };
            let rest = bytes.get(at..).unwrap_or_default();
            let length = rest.iter().position(|byte| *byte == b'\n');
            let length = length.ok_or_else(|| error(PcdFault::HeaderTruncated))?;
            let text = std::str::from_utf8(&rest[..length]).map_err(|_| error(PcdFault::NotText))?;
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
                "FIELDS" => fields = words.iter().map(|word| (*word).to_owned()).collect(),
                "SIZE" => sizes = integers(&words).map_err(error)?,
                "COUNT" => counts = integers(&words).map_err(error)?,
                "TYPE" => kinds = words.iter().map(|word| (*word).to_owned()).collect(),
                "WIDTH" => width = Some(count()?),
                "HEIGHT" => height = Some(count()?),
                "POINTS" => n_points = Some(count()?),
                "DATA" => {
                    let is_binary = match words.first() {
                        Some(&"binary") => true,
                        Some(&"ascii") => false,
                        other => {
                            return Err(error(PcdFault::Encoding(other.copied().unwrap_or_default().to_owned())));
                        }
                    };
                    let n_points = n_points.or(width.zip(height).and_then(|(w, h)| w.checked_mul(h)));
                    let n_points = n_points.ok_or_else(|| error(PcdFault::NoCount))?;
                    let (values, row_bytes, row_words) = layout(&fields, &sizes, &kinds, &counts).map_err(error)?;
                    return Ok(Self { values, row_bytes, row_words, n_points, is_binary, n_lines: line, n_bytes: at });
                }
                // VERSION, VIEWPOINT, comments and unknown keywords are ignored.
                _ => {}
            }
        }
        Err(PcdError { line: MAX_HEADER_LINES, fault: PcdFault::NoData })
    }
}

fn integers(words: &[&str]) -> Result<Vec<usize>, PcdFault> {
    let integer = |word: &&str| {
        let number = word.parse::<usize>().ok().filter(|number| *number <= MAX_ROW_VALUES);
        number.ok_or_else(|| PcdFault::Integer { found: (*word).to_owned(), limit: MAX_ROW_VALUES })
    };
    words.iter().map(integer).collect()
}

/// Positions of the values that are read, bytes of a row and words of a row.
fn layout(
    fields: &[String],
    sizes: &[usize],
    kinds: &[String],
    counts: &[usize],
) -> Result<([Option<Value>; N_WANTED], usize, usize), PcdFault> {
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
    let mut values = [None; N_WANTED];
    let mut row_bytes = 0;
    let mut row_words = 0;
    for (index, field) in fields.iter().enumerate() {
        let size = sizes[index];
        let count = counts.get(index).copied().unwrap_or(1);
        let kind = kinds[index].bytes().next().unwrap_or_default();
        let is_known = match kind {
            b'F' => matches!(size, 4 | 8),
            b'I' | b'U' => matches!(size, 1 | 2 | 4 | 8),
            _ => false,
        };
        if !is_known {
            return Err(PcdFault::Type { field: field.clone(), kind: kinds[index].clone(), size });
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
        return Err(PcdFault::RowLength { found: row_words, limit: MAX_ROW_VALUES });
    }
    match values[..3].iter().position(Option::is_none) {
        None => Ok((values, row_bytes, row_words)),
        Some(missing) => Err(PcdFault::MissingField(WANTED[missing])),
    }
}
