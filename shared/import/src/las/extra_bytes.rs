//! Extra bytes of LAS: fields of the writer after the fields of the point format, described by a record of the header.

use super::{u16_at, u32_at};
use formats::cloud_fields::{Field, ValueType};
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes of a description.
const DESCRIPTION_BYTES: usize = 192;
/// Number of the record among the records of `LASF_Spec`.
const RECORD_ID: u16 = 4;
/// Bytes before the content of a record.
const HEAD_BYTES: u64 = 54;

/// A field of the extra bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ExtraField {
    at: usize,
    value_type: ValueType,
}

impl ExtraField {
    /// The value in a record.
    pub fn value(self, record: &[u8]) -> f64 {
        self.value_type.decode(record.get(self.at..).unwrap_or_default(), false)
    }

    /// Offset after the field.
    pub fn end(self) -> usize {
        self.at + self.value_type.size()
    }
}

/// The number of the beam, by its names. `first`: offset of the extra bytes in a record.
pub(super) fn beam(file: &mut (impl Read + Seek), header: &[u8], first: usize) -> io::Result<Option<ExtraField>> {
    let data_at = u64::from(u32_at(header, 96));
    let mut at = u64::from(u16_at(header, 94));
    for _ in 0..u32_at(header, 100) {
        let mut head = [0; HEAD_BYTES as usize];
        if at + HEAD_BYTES > data_at {
            break;
        }
        file.seek(SeekFrom::Start(at))?;
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let length = usize::from(u16_at(&head, 20));
        if head[2..18].starts_with(b"LASF_Spec") && u16_at(&head, 18) == RECORD_ID {
            let mut content = vec![0; length];
            file.read_exact(&mut content)?;
            return Ok(beam_of(&content, first));
        }
        at += HEAD_BYTES + length as u64;
    }
    Ok(None)
}

/// The beam among descriptions.
fn beam_of(descriptions: &[u8], first: usize) -> Option<ExtraField> {
    let mut fields = Vec::new();
    let mut at = first;
    for description in descriptions.chunks_exact(DESCRIPTION_BYTES) {
        let name = String::from_utf8_lossy(&description[4..36]);
        let name = name.trim_end_matches('\0').to_owned();
        // A type that is not a number: its size is in the options.
        let Some(value_type) = value_type(description[2]) else {
            if description[2] != 0 {
                break;
            }
            at += usize::from(description[3]);
            continue;
        };
        fields.push((name, ExtraField { at, value_type }));
        at += value_type.size();
    }
    let index = Field::Ring.find(&fields.iter().map(|(name, _)| name.as_str()))?;
    Some(fields[index].1)
}

fn value_type(code: u8) -> Option<ValueType> {
    let types = [
        ValueType::U8,
        ValueType::I8,
        ValueType::U16,
        ValueType::I16,
        ValueType::U32,
        ValueType::I32,
        ValueType::U64,
        ValueType::I64,
        ValueType::F32,
        ValueType::F64,
    ];
    types.get(usize::from(code).checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn description(code: u8, options: u8, name: &str) -> Vec<u8> {
        let mut bytes = vec![0; DESCRIPTION_BYTES];
        bytes[2] = code;
        bytes[3] = options;
        bytes[4..4 + name.len()].copy_from_slice(name.as_bytes());
        bytes
    }

    #[test]
    fn beam_is_found_after_other_fields() {
        let all = [description(9, 0, "Reflectance"), description(0, 3, "raw"), description(3, 0, "Ring")].concat();
        let beam = beam_of(&all, 28).expect("is there");
        assert_eq!(beam, ExtraField { at: 35, value_type: ValueType::U16 });
        assert_eq!((beam.end(), beam.value(&[vec![0; 35], vec![7, 1]].concat())), (37, 263.0));
        assert_eq!(beam_of(&all[..2 * DESCRIPTION_BYTES], 28), None);
        assert_eq!(beam_of(&[description(20, 0, "x[2]"), description(3, 0, "Ring")].concat(), 28), None);
    }
}
