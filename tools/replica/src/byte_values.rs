//! Decodes the numbers of a message from its bytes, by its byte table.

use anyhow::{Context, bail};
use messages::ByteField;
use recording::kind_bytes;
use std::fmt;

/// One number of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// `u8` to `u64`.
    Unsigned(u64),
    /// `i8` to `i64`.
    Signed(i64),
    /// `f32`.
    Single(f32),
    /// `f64`.
    Double(f64),
}

impl fmt::Display for Number {
    /// The shortest text that parses to the same number; NaN, inf and -inf for the others.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Number::Unsigned(value) => value.fmt(f),
            Number::Signed(value) => value.fmt(f),
            Number::Single(value) => value.fmt(f),
            Number::Double(value) => value.fmt(f),
        }
    }
}

impl Number {
    /// Absolute difference. NaN if the kinds differ or a number is NaN.
    pub fn distance(self, other: Self) -> f64 {
        match (self, other) {
            (Number::Unsigned(a), Number::Unsigned(b)) => a.abs_diff(b) as f64,
            (Number::Signed(a), Number::Signed(b)) => a.abs_diff(b) as f64,
            (Number::Single(a), Number::Single(b)) => (f64::from(a) - f64::from(b)).abs(),
            (Number::Double(a), Number::Double(b)) => (a - b).abs(),
            _ => f64::NAN,
        }
    }

    /// The number in JSON, where NaN and infinity become `null`.
    pub fn json(self) -> String {
        match self {
            Number::Single(value) if !value.is_finite() => "null".to_owned(),
            Number::Double(value) if !value.is_finite() => "null".to_owned(),
            other => other.to_string(),
        }
    }
}

/// The numbers of `field` in the bytes of its struct.
pub fn numbers(field: &ByteField, bytes: &[u8]) -> anyhow::Result<Vec<Number>> {
    let size = kind_bytes(&field.kind).with_context(|| format!("field {}: unknown kind {}", field.name, field.kind))?;
    let end = field.offset + size * field.count;
    let bytes = bytes.get(field.offset..end).with_context(|| {
        format!("field {} ends at byte {end}, but its struct has {} bytes", field.name, bytes.len())
    })?;
    bytes.chunks_exact(size).map(|bytes| number(&field.kind, bytes)).collect()
}

/// One little-endian number. `bytes` must have the length of the kind.
pub fn number(kind: &str, bytes: &[u8]) -> anyhow::Result<Number> {
    let mut word = [0; 8];
    word[..bytes.len()].copy_from_slice(bytes);
    let word = u64::from_le_bytes(word);
    Ok(match kind {
        "u8" | "u16" | "u32" | "u64" => Number::Unsigned(word),
        "i8" => Number::Signed(i64::from(word as i8)),
        "i16" => Number::Signed(i64::from(word as i16)),
        "i32" => Number::Signed(i64::from(word as i32)),
        "i64" => Number::Signed(word as i64),
        "f32" => Number::Single(f32::from_bits(word as u32)),
        "f64" => Number::Double(f64::from_bits(word)),
        other => bail!("unknown kind {other}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(offset: usize, kind: &str, count: usize) -> ByteField {
        ByteField { name: "value".to_owned(), offset, kind: kind.to_owned(), count }
    }

    #[test]
    fn every_kind_is_decoded_at_its_offset() {
        let bytes = [0xff, 0xfe, 0xff, 0, 0, 0x80, 0x3f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f];
        let read = |offset, kind, count| numbers(&field(offset, kind, count), &bytes).expect("inside");
        assert_eq!(read(0, "u8", 2), [Number::Unsigned(255), Number::Unsigned(254)]);
        assert_eq!(read(0, "i8", 1), [Number::Signed(-1)]);
        assert_eq!(read(1, "i16", 1), [Number::Signed(-2)]);
        assert_eq!(read(3, "f32", 1), [Number::Single(1.0)]);
        assert_eq!(read(7, "i64", 1), [Number::Signed(i64::MAX)]);
        let nan = read(7, "f64", 1)[0];
        assert_eq!((nan.to_string(), nan.json()), ("NaN".to_owned(), "null".to_owned()));
        assert_eq!(Number::Single(0.1).json(), "0.1", "an f32 is not printed with the digits of an f64");
        assert_eq!(Number::Double(f64::NEG_INFINITY).to_string(), "-inf");
    }

    #[test]
    fn field_beyond_the_bytes_or_of_unknown_kind_is_an_error() {
        assert!(numbers(&field(8, "u32", 2), &[0; 15]).is_err());
        let error = numbers(&field(0, "f16", 1), &[0; 15]).expect_err("no such kind");
        assert!(format!("{error:#}").contains("f16"), "{error:#}");
    }
}
