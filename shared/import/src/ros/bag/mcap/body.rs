//! Values of the bodies of records.

use crate::ros::bag::record::{array, read_bytes};
use std::io::{self, Read};

/// Longest text in the header of a chunk: the name of a compression.
const MAX_NAME: u32 = 64;

/// Channels and their numbers of messages.
pub(super) type ChannelCounts = Vec<(u16, u64)>;

/// Reads a body from its start.
#[derive(Clone, Copy)]
pub(super) struct Body<'a> {
    rest: &'a [u8],
}

impl<'a> Body<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let (first, rest) = self.rest.split_first_chunk().ok_or(io::ErrorKind::UnexpectedEof)?;
        self.rest = rest;
        Ok(*first)
    }

    pub fn u16(&mut self) -> io::Result<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> io::Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> io::Result<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub fn text(&mut self) -> io::Result<String> {
        let n_bytes = self.u32()? as usize;
        let (text, rest) = self.rest.split_at_checked(n_bytes).ok_or(io::ErrorKind::UnexpectedEof)?;
        self.rest = rest;
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    /// Time of the first message, if there is one, and channels and their messages in a statistics record.
    pub fn statistics(mut self) -> io::Result<(Option<i64>, ChannelCounts)> {
        let n_messages = self.u64()?;
        // schemas u16, channels, attachments, metadata and chunks u32
        self.array::<18>()?;
        let first = self.u64()? as i64;
        let _last = self.u64()?;
        let first = Some(first).filter(|_| n_messages > 0);
        let n_bytes = self.u32()? as usize;
        let entries = self.rest.get(..n_bytes).ok_or(io::ErrorKind::UnexpectedEof)?;
        let mut entries = Body::new(entries);
        let mut counts = Vec::new();
        while !entries.rest.is_empty() {
            counts.push((entries.u16()?, entries.u64()?));
        }
        Ok((first, counts))
    }
}

/// Header of a chunk.
pub(super) struct ChunkHead {
    pub content_bytes: u64,
    pub crc: u32,
    pub compression: String,
    pub data_bytes: u64,
}

impl ChunkHead {
    pub fn read(reader: &mut impl Read) -> io::Result<Self> {
        let _times: [u8; 16] = array(reader)?;
        let content_bytes = u64::from_le_bytes(array(reader)?);
        let crc = u32::from_le_bytes(array(reader)?);
        let n_name = u32::from_le_bytes(array(reader)?);
        let mut name = Vec::new();
        read_bytes(reader, u64::from(n_name.min(MAX_NAME)), &mut name)?;
        let data_bytes = u64::from_le_bytes(array(reader)?);
        Ok(Self { content_bytes, crc, compression: String::from_utf8_lossy(&name).into_owned(), data_bytes })
    }
}
