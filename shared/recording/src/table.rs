//! Checks of byte tables read from files.

use super::MAX_RECORD;
use super::error::RecordFault;
use messages::ByteTable;

/// Whether a table from a file is usable: known kinds, and fields inside their parts.
pub(super) fn check(table: &ByteTable) -> Result<(), RecordFault> {
    let ByteTable { topic, header_bytes, row_bytes, .. } = table;
    if !(1..=MAX_RECORD).contains(row_bytes) || *header_bytes > MAX_RECORD {
        let header_bytes = *header_bytes;
        let row_bytes = *row_bytes;
        let limit = MAX_RECORD;
        return Err(RecordFault::TableSize { topic: topic.clone(), header_bytes, row_bytes, limit });
    }
    let parts = [
        ("envelope", &table.envelope, 64),
        ("header", &table.header, table.header_bytes),
        ("row", &table.row, table.row_bytes),
    ];
    for (part, fields, bytes) in parts {
        for field in fields {
            let size = kind_bytes(&field.kind).and_then(|size| size.checked_mul(field.count));
            let end = size.and_then(|size| size.checked_add(field.offset));
            if end.is_none_or(|end| end > bytes) {
                let topic = topic.clone();
                let field = Box::new(field.clone());
                return Err(RecordFault::TableField { topic, part, field, bytes });
            }
        }
    }
    Ok(())
}

/// Bytes of a number of a [`messages::ByteField::kind`]; `None` for an unknown kind.
pub fn kind_bytes(kind: &str) -> Option<usize> {
    match kind {
        "u8" | "i8" => Some(1),
        "u16" | "i16" => Some(2),
        "u32" | "i32" | "f32" => Some(4),
        "u64" | "i64" | "f64" => Some(8),
        _ => None,
    }
}
