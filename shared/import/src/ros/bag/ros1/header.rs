//! Headers of records.

use crate::ros::bag::record::{array, read_bytes};
use std::collections::BTreeMap;
use std::io::{self, Read};

/// Longest header, bytes. Headers of messages have fifty.
const MAX_HEADER: u32 = 1 << 20;

/// Fields of a header.
pub(super) struct Header {
    fields: BTreeMap<String, Vec<u8>>,
}

fn invalid(rule: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, rule)
}

impl Header {
    /// The header of a record that begins here.
    pub fn read(reader: &mut impl Read) -> io::Result<Self> {
        let n_bytes = u32::from_le_bytes(array(reader)?);
        Self::read_long(reader, n_bytes)
    }

    /// A header of `n_bytes`.
    pub fn read_long(reader: &mut impl Read, n_bytes: u32) -> io::Result<Self> {
        if n_bytes > MAX_HEADER {
            return Err(invalid(format!("a header of {n_bytes} bytes; at most {MAX_HEADER} are read")));
        }
        let mut bytes = Vec::new();
        read_bytes(reader, u64::from(n_bytes), &mut bytes)?;
        Self::from_bytes(&bytes)
    }

    pub fn from_bytes(mut bytes: &[u8]) -> io::Result<Self> {
        let mut fields = BTreeMap::new();
        while let Some((length, rest)) = bytes.split_first_chunk() {
            let (field, rest) =
                rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(io::ErrorKind::UnexpectedEof)?;
            let equals = field.iter().position(|byte| *byte == b'=');
            let equals = equals.ok_or_else(|| invalid("a header field without `=`".into()))?;
            fields.insert(String::from_utf8_lossy(&field[..equals]).into_owned(), field[equals + 1..].to_vec());
            bytes = rest;
        }
        if bytes.is_empty() { Ok(Self { fields }) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }

    /// Kind of the record.
    pub fn kind(&self) -> Option<u8> {
        self.fields.get("op").and_then(|value| value.first().copied())
    }

    pub fn text(&self, name: &str) -> Option<String> {
        self.fields.get(name).map(|value| String::from_utf8_lossy(value).into_owned())
    }

    pub fn u32(&self, name: &str) -> io::Result<u32> {
        self.array(name).map(u32::from_le_bytes)
    }

    pub fn u64(&self, name: &str) -> io::Result<u64> {
        self.array(name).map(u64::from_le_bytes)
    }

    fn array<const N: usize>(&self, name: &str) -> io::Result<[u8; N]> {
        let value = self.fields.get(name).ok_or_else(|| invalid(format!("the header has no field {name}")))?;
        value[..].try_into().map_err(|_| invalid(format!("field {name} has {} bytes; must be {N}", value.len())))
    }
}
