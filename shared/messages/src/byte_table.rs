//! The layout of a message type, for readers that do not have the type: observers, recordings, other languages.

use crate::{Envelope, Message, Pod, SubmapTopic, TrajectoryTopic};
use serde::{Deserialize, Serialize};

/// One field: `count` numbers of kind `kind` in a row, from byte `offset` on, little-endian.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ByteField {
    /// Name; a field of a nested struct is `outer.inner`, an element of an array of structs `outer.0.inner`.
    pub name: String,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// `u8`, `u16`, `u32`, `u64`, `i8`, `i16`, `i32`, `i64`, `f32` or `f64`.
    pub kind: String,
    /// Numbers of that kind; 1 unless the field is an array.
    pub count: usize,
}

/// The layout of a topic's messages: envelope, header, rows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ByteTable {
    /// [`Message::TOPIC`].
    pub topic: String,
    /// [`Message::VERSION`].
    pub version: u32,
    /// [`Message::LAYOUT`].
    pub layout: u64,
    /// Bytes of the header.
    pub header_bytes: usize,
    /// Bytes of a row.
    pub row_bytes: usize,
    /// [`Message::MAX_ROWS`].
    pub max_rows: usize,
    /// Fields of the [`Envelope`].
    pub envelope: Vec<ByteField>,
    /// Fields of the header.
    pub header: Vec<ByteField>,
    /// Fields of a row.
    pub row: Vec<ByteField>,
}

impl ByteTable {
    /// The table of `T`.
    pub fn of<T: Message>() -> Self {
        Self {
            topic: T::TOPIC.to_owned(),
            version: T::VERSION,
            layout: T::LAYOUT,
            header_bytes: size_of::<T::Header>(),
            row_bytes: size_of::<T::Row>(),
            max_rows: T::MAX_ROWS,
            envelope: fields_of::<Envelope>(),
            header: fields_of::<T::Header>(),
            row: fields_of::<T::Row>(),
        }
    }

    /// The table under the current names of its fields, for recordings from before poses in odom were renamed from `world_from_...`
    /// to `odom_from_...` in topics `submap` and `trajectory`. The bytes are the same, only names and fingerprint differ. Any other
    /// table is returned as it is.
    #[must_use]
    pub fn with_current_names(self) -> Self {
        let current = match self.topic.as_str() {
            SubmapTopic::TOPIC => Self::of::<SubmapTopic>(),
            TrajectoryTopic::TOPIC => Self::of::<TrajectoryTopic>(),
            _ => return self,
        };
        let mut renamed = Self { layout: current.layout, ..self.clone() };
        for field in renamed.header.iter_mut().chain(&mut renamed.row) {
            if let Some(frame) = field.name.strip_prefix("world_from_") {
                field.name = format!("odom_from_{frame}");
            }
        }
        if renamed == current { current } else { self }
    }
}

fn fields_of<P: Pod>() -> Vec<ByteField> {
    let mut fields = Vec::new();
    P::describe("", 0, &mut fields);
    fields
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TickTopic;

    #[test]
    fn fields_cover_every_byte_once() {
        for table in [ByteTable::of::<SubmapTopic>(), ByteTable::of::<TickTopic>()] {
            for (fields, bytes) in [
                (&table.envelope, size_of::<Envelope>()),
                (&table.header, table.header_bytes),
                (&table.row, table.row_bytes),
            ] {
                let mut at = 0;
                for field in fields {
                    assert_eq!(field.offset, at, "{}.{}", table.topic, field.name);
                    let bits: usize = field.kind[1..].parse().expect("a kind ends with its bits");
                    at += bits / 8 * field.count;
                }
                assert_eq!(at, bytes, "{}", table.topic);
            }
        }
    }

    #[test]
    fn table_with_former_names_becomes_the_current_one() {
        for current in [ByteTable::of::<SubmapTopic>(), ByteTable::of::<TrajectoryTopic>()] {
            let mut former = ByteTable { layout: 1, ..current.clone() };
            for field in former.header.iter_mut().chain(&mut former.row) {
                field.name = field.name.replace("odom_from_", "world_from_");
            }
            assert_ne!(former, current);
            assert_eq!(former.clone().with_current_names(), current);
            // A table that differs in more than names is returned unchanged.
            former.version += 1;
            assert_eq!(former.clone().with_current_names(), former);
        }
    }

    #[test]
    fn nested_fields_and_arrays_have_full_names() {
        let table = ByteTable::of::<TickTopic>();
        let barrier = table.row.iter().find(|field| field.name == "barrier").expect("there");
        assert_eq!((barrier.offset, barrier.kind.as_str(), barrier.count), (16, "u64", 1));
        let reserved = table.envelope.iter().find(|field| field.name == "reserved").expect("there");
        assert_eq!((reserved.offset, reserved.kind.as_str(), reserved.count), (48, "u32", 4));
    }
}
