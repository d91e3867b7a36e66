//! The record format: a header with the kind of each value, then the values.

use super::error::SqliteFault;

/// A value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    /// NULL; also the id of a row, which is not stored in its record.
    Null,
    /// An integer.
    Int(i64),
    /// A floating-point number.
    Real(f64),
    /// Text, UTF-8 unless damaged.
    Text(&'a [u8]),
    /// Bytes.
    Blob(&'a [u8]),
}

/// A number of 1 to 9 bytes, big-endian, 7 bits per byte, and its size.
pub(super) fn varint(bytes: &[u8]) -> Result<(u64, usize), SqliteFault> {
    let mut value = 0;
    for (index, byte) in bytes.iter().enumerate().take(9) {
        if index == 8 {
            return Ok((value << 8 | u64::from(*byte), 9));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Ok((value, index + 1));
        }
    }
    Err(SqliteFault::Outside { what: "a number" })
}

/// Value `column` of a record; `None` if the record has fewer values. The record may be cut after the value.
pub(super) fn value(record: &[u8], column: usize) -> Result<Option<Value<'_>>, SqliteFault> {
    let outside = SqliteFault::Outside { what: "a value" };
    let (header_bytes, mut at) = varint(record)?;
    let Some(header) = usize::try_from(header_bytes).ok().and_then(|end| record.get(..end)) else {
        return Err(outside);
    };
    let mut begin = header.len();
    for index in 0.. {
        if at >= header.len() {
            break;
        }
        let (kind, n) = varint(&header[at..])?;
        at += n;
        let n_bytes = size(kind).ok_or(SqliteFault::Outside { what: "a kind" })?;
        let end = begin.checked_add(n_bytes);
        if index == column {
            let bytes = end.and_then(|end| record.get(begin..end)).ok_or(outside)?;
            return Ok(Some(decode_value(kind, bytes)));
        }
        let Some(end) = end else { return Err(outside) };
        begin = end;
    }
    Ok(None)
}

fn size(kind: u64) -> Option<usize> {
    match kind {
        0 | 8 | 9 => Some(0),
        1..=4 => Some(kind as usize),
        5 => Some(6),
        6 | 7 => Some(8),
        10 | 11 => None,
        text_or_blob => usize::try_from((text_or_blob - 12) / 2).ok(),
    }
}

fn decode_value(kind: u64, bytes: &[u8]) -> Value<'_> {
    let integer = || {
        let first = if bytes.first().is_some_and(|byte| byte & 0x80 != 0) { -1 } else { 0 };
        bytes.iter().fold(first, |sum: i64, byte| sum << 8 | i64::from(*byte))
    };
    match kind {
        0 => Value::Null,
        7 => Value::Real(f64::from_bits(integer() as u64)),
        8 | 9 => Value::Int(kind as i64 - 8),
        kind if kind >= 12 && kind % 2 == 0 => Value::Blob(bytes),
        kind if kind >= 12 => Value::Text(bytes),
        _ => Value::Int(integer()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_all_kinds_are_decoded() {
        // 1 null, i8, i24, i48, i64, f64, 0, 1, text of 2, blob of 1.
        let mut record = vec![11, 0, 1, 3, 5, 6, 7, 8, 9, 17, 14];
        record.extend([0xff]);
        record.extend([0x80, 0, 0]);
        record.extend([0, 0, 0, 1, 0, 0]);
        record.extend((-5_i64).to_be_bytes());
        record.extend(0.25_f64.to_be_bytes());
        record.extend(b"ab\x07");
        let found: Vec<Value> =
            (0..10).map(|column| value(&record, column).expect("valid").expect("is there")).collect();
        assert_eq!(
            found,
            [
                Value::Null,
                Value::Int(-1),
                Value::Int(-8_388_608),
                Value::Int(65_536),
                Value::Int(-5),
                Value::Real(0.25),
                Value::Int(0),
                Value::Int(1),
                Value::Text(b"ab"),
                Value::Blob(&[7]),
            ]
        );
        assert_eq!(value(&record, 10).expect("valid"), None);
        for n in 0..record.len() {
            assert!(value(&record[..n], 9).is_err(), "{n} bytes");
        }
    }

    #[test]
    fn numbers_have_up_to_nine_bytes() {
        assert_eq!(varint(&[0x7f, 9]).expect("valid"), (127, 1));
        assert_eq!(varint(&[0x81, 0x00]).expect("valid"), (128, 2));
        assert_eq!(varint(&[0xff; 9]).expect("valid"), (u64::MAX, 9));
        assert!(varint(&[0x80, 0x80]).is_err() && varint(&[]).is_err());
    }
}
