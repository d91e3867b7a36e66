//! Files that are not plain little-endian rows: ASCII, big-endian, and files with lists. ply-rs decodes them one row at a time;
//! the scalars are packed as in a plain file.

use super::{PayloadFault, PlyError};
use crate::cloud_fields::number;
use ply_rs::parser::{ParseError, Parser};
use ply_rs::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use std::path::Path;
use std::str::Utf8Error;

/// One packed row. Properties come in the order of the header; lists are skipped.
struct PackedRow(Vec<u8>);

impl PropertyAccess for PackedRow {
    fn new() -> Self {
        Self(Vec::new())
    }
    fn set_property(&mut self, _name: &str, value: Property) -> PropertyAccessResult {
        match value {
            Property::Char(v) => self.0.extend(v.to_le_bytes()),
            Property::UChar(v) => self.0.extend(v.to_le_bytes()),
            Property::Short(v) => self.0.extend(v.to_le_bytes()),
            Property::UShort(v) => self.0.extend(v.to_le_bytes()),
            Property::Int(v) => self.0.extend(v.to_le_bytes()),
            Property::UInt(v) => self.0.extend(v.to_le_bytes()),
            Property::Float(v) => self.0.extend(v.to_le_bytes()),
            Property::Double(v) => self.0.extend(v.to_le_bytes()),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// A row that cannot be decoded.
#[derive(Debug, thiserror::Error)]
enum RowError {
    #[error("the file ends before this row")]
    EndOfFile,
    #[error("not text: {0}")]
    NotText(Utf8Error),
    #[error("{0}")]
    Parse(ParseError),
}

/// The packed rows of an element of `bytes`, whose header ends at `start`.
pub(super) fn packed_rows(
    head: &Header,
    name: &str,
    bytes: &[u8],
    start: usize,
    path: &Path,
) -> Result<Vec<u8>, PlyError> {
    let parser = Parser::<PackedRow>::new();
    let mut rest = &bytes[start..];
    let mut packed = Vec::new();
    for element in head.elements.values() {
        // A row without fields takes no bytes, so a wrong number of such rows would loop almost forever.
        if element.properties.is_empty() {
            continue;
        }
        for row in 0..element.count {
            let at = bytes.len() - rest.len();
            let values = match head.encoding {
                Encoding::Ascii => ascii_row(&parser, &mut rest, element),
                Encoding::BinaryBigEndian => {
                    parser.read_big_endian_element(&mut rest, element).map_err(RowError::Parse)
                }
                Encoding::BinaryLittleEndian => {
                    parser.read_little_endian_element(&mut rest, element).map_err(RowError::Parse)
                }
            };
            let values = values.map_err(|error| {
                let fault = PayloadFault::Row { row, element: element.name.clone(), cause: Box::new(error) };
                PlyError::payload(path, at, fault)
            })?;
            if element.name == name {
                packed.extend_from_slice(&values.0);
            }
        }
        if element.name == name {
            break;
        }
    }
    Ok(packed)
}

fn ascii_row(parser: &Parser<PackedRow>, rest: &mut &[u8], element: &ElementDef) -> Result<PackedRow, RowError> {
    if rest.is_empty() {
        return Err(RowError::EndOfFile);
    }
    let end = rest.iter().position(|byte| *byte == b'\n').map_or(rest.len(), |newline| newline + 1);
    let (line, after) = rest.split_at(end);
    *rest = after;
    let line = std::str::from_utf8(line).map_err(RowError::NotText)?;
    // ply-rs reads digits only: neither nan nor inf.
    if line.contains(['n', 'N', '#'])
        && let Some(row) = row_with_nans(line, element)
    {
        return Ok(row);
    }
    parser.read_ascii_element(line, element).map_err(RowError::Parse)
}

/// A row with invalid numbers. `None` if it has another fault, or more or fewer values than its element.
fn row_with_nans(line: &str, element: &ElementDef) -> Option<PackedRow> {
    let mut row = PackedRow::new();
    let mut words = line.split_ascii_whitespace();
    for property in element.properties.values() {
        let scalar = match &property.data_type {
            PropertyType::Scalar(scalar) => scalar,
            PropertyType::List(..) => {
                let n: usize = words.next()?.parse().ok()?;
                for _ in 0..n {
                    words.next()?;
                }
                continue;
            }
        };
        let word = words.next()?;
        let value = match scalar {
            ScalarType::Char => Property::Char(word.parse().ok()?),
            ScalarType::UChar => Property::UChar(word.parse().ok()?),
            ScalarType::Short => Property::Short(word.parse().ok()?),
            ScalarType::UShort => Property::UShort(word.parse().ok()?),
            ScalarType::Int => Property::Int(word.parse().ok()?),
            ScalarType::UInt => Property::UInt(word.parse().ok()?),
            ScalarType::Float => Property::Float(word.parse().ok().or_else(|| number(word).map(|value| value as f32))?),
            ScalarType::Double => Property::Double(number(word)?),
        };
        row.set_property(&property.name, value);
    }
    words.next().is_none().then_some(row)
}
