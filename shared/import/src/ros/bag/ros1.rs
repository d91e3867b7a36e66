//! ROS 1 bags, version 2.0 (<http://wiki.ros.org/Bags/Format/2.0>).
//!
//! A record is the length of its header (u32), the header (fields `name=value` after their length, u32), the length of
//! its data (u32), and the data; all numbers are little-endian. The index at the end has the connections and the
//! positions of the chunks. A chunk contains the records of its messages.

mod header;

use super::decompress::{ContentLimit, decompressed};
use super::record::{AtByte, Checked, Skip, array, array_or_end, read_bytes};
use super::topics::{Encoding, Topics};
use super::{Container, Each, Message};
use crate::error::{At, ImportError};
use files::regular_file;
use header::Header;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

const MESSAGE: u8 = 2;
const BAG: u8 = 3;
const CHUNK: u8 = 5;
const CHUNK_INFO: u8 = 6;
const CONNECTION: u8 = 7;

pub(super) struct Ros1 {
    path: PathBuf,
    topics: Topics,
    /// Topics of the connections.
    connections: BTreeMap<u32, usize>,
    /// Offsets of the chunks, in the order of the file.
    chunks: Vec<u64>,
    /// Time of the first message, ns.
    begin: Option<i64>,
}

impl Ros1 {
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let mut file = BufReader::new(regular_file::open(path).at(path)?);
        let n_bytes = file.get_ref().metadata().at(path)?.len();
        let mut magic = [0; MAGIC.len()];
        file.read_exact(&mut magic).at_byte(path, 0)?;
        if magic != *MAGIC {
            let rule =
                format!("{:?} must be version 2.0; run `rosbag fix`", String::from_utf8_lossy(&magic).trim_end());
            return Err(ImportError::at(path, rule));
        }
        let at = MAGIC.len() as u64;
        let fault = |rule: String| ImportError::at_part(path, &format!("byte {at}"), rule);
        let (header, _) =
            Header::read(&mut file).and_then(|header| Ok((header, length(&mut file)?))).at_byte(path, at)?;
        if header.kind() != Some(BAG) {
            return Err(fault("the first record must be a bag header".into()));
        }
        if let Some(encryptor) = header.text("encryptor").filter(|name| !name.is_empty()) {
            return Err(fault(format!("the bag is encrypted ({encryptor}); run `rosbag decompress`")));
        }
        let index = header.u64("index_pos").at_byte(path, at)?;
        if index == 0 {
            return Err(ImportError::at(path, "has no index: the recording was not closed; run `rosbag reindex`"));
        }
        if index >= n_bytes {
            return Err(fault(format!("the index is at byte {index}, the file has {n_bytes} bytes: it is cut")));
        }
        let mut bag = Self {
            path: path.to_owned(),
            topics: Topics::default(),
            connections: BTreeMap::new(),
            chunks: Vec::new(),
            begin: None,
        };
        bag.read_index(&mut file, index, n_bytes)?;
        Ok(bag)
    }

    fn read_index(&mut self, file: &mut BufReader<File>, mut at: u64, n_bytes: u64) -> Result<(), ImportError> {
        let path = self.path.clone();
        file.seek(SeekFrom::Start(at)).at(&path)?;
        let mut data = Vec::new();
        let mut counts = Vec::new();
        while at < n_bytes {
            let header = Header::read(file).at_byte(&path, at)?;
            let n_data = length(file).at_byte(&path, at)?;
            read_bytes(file, n_data, &mut data).at_byte(&path, at)?;
            match header.kind() {
                Some(CONNECTION) => {
                    let connection = header.u32("conn").at_byte(&path, at)?;
                    let fields = Header::from_bytes(&data).at_byte(&path, at)?;
                    let topic = header.text("topic");
                    let kind = fields.text("type");
                    let index =
                        self.topics.add(&topic.unwrap_or_default(), &kind.unwrap_or_default(), Some(Encoding::Ros1));
                    self.connections.insert(connection, index);
                }
                Some(CHUNK_INFO) => {
                    self.chunks.push(header.u64("chunk_pos").at_byte(&path, at)?);
                    let begin = nanos(header.u64("start_time").at_byte(&path, at)?);
                    self.begin = Some(self.begin.map_or(begin, |first| first.min(begin)));
                    let (entries, _) = data.as_chunks::<8>();
                    let u32_of = |bytes: &[u8]| bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
                    counts.extend(entries.iter().map(|entry| (u32_of(&entry[..4]), u32_of(&entry[4..]))));
                }
                kind => {
                    let rule = format!("a record of kind {kind:?} in the index; must be a connection or a chunk info");
                    return Err(ImportError::at_part(&path, &format!("byte {at}"), rule));
                }
            }
            at = file.stream_position().at(&path)?;
        }
        for (connection, n) in counts {
            if let Some(topic) = self.connections.get(&connection) {
                self.topics.count(*topic, u64::from(n));
            }
        }
        self.chunks.sort_unstable();
        // A position that is listed twice would be read twice.
        self.chunks.dedup();
        Ok(())
    }

    /// Passes the messages of the chunk at byte `at`. Returns the offset of its end.
    fn chunk(
        &self,
        file: &mut BufReader<File>,
        at: u64,
        wanted: &[Cell<bool>],
        each: &mut Each<'_>,
        content_limit: &mut ContentLimit,
    ) -> Result<u64, ImportError> {
        let path = &self.path;
        let fault = |rule: String| ImportError::at_part(path, &format!("byte {at}"), rule);
        file.seek(SeekFrom::Start(at)).at(path)?;
        let header = Header::read(file).at_byte(path, at)?;
        if header.kind() != Some(CHUNK) {
            return Err(fault("the index says that a chunk begins here, but there is another record".into()));
        }
        let n_data = length(file).at_byte(path, at)?;
        let end = file.stream_position().at(path)?.saturating_add(n_data);
        let content_bytes = u64::from(header.u32("size").at_byte(path, at)?);
        content_limit.take(content_bytes).at_byte(path, at)?;
        let mut data = Vec::new();
        let compression = header.text("compression").unwrap_or_default();
        let content = decompressed(&compression, file.by_ref().take(n_data)).at_byte(path, at)?;
        let mut content: Box<dyn Read + '_> = Box::new(Checked::new(content, content_bytes, 0));
        while let Some(n_header) = array_or_end(&mut content).at_byte(path, at)? {
            let header = Header::read_long(&mut content, u32::from_le_bytes(n_header)).at_byte(path, at)?;
            let n_data = length(&mut content).at_byte(path, at)?;
            if header.kind() != Some(MESSAGE) {
                content.skip(n_data).at_byte(path, at)?;
                continue;
            }
            let connection = header.u32("conn").at_byte(path, at)?;
            let Some(&topic) = self.connections.get(&connection) else {
                return Err(fault(format!("a message of connection {connection}, which is not in the index")));
            };
            if !wanted.get(topic).is_some_and(Cell::get) {
                content.skip(n_data).at_byte(path, at)?;
                continue;
            }
            let time = header.u64("time").at_byte(path, at)?;
            read_bytes(&mut content, n_data, &mut data).at_byte(path, at)?;
            each(Message { topic, received: nanos(time), data: &data })?;
        }
        Ok(end)
    }
}

/// A time: seconds in the low half, ns in the high one.
fn nanos(time: u64) -> i64 {
    (time & 0xffff_ffff) as i64 * 1_000_000_000 + (time >> 32) as i64
}

/// Length of the data of a record.
fn length(reader: &mut impl Read) -> io::Result<u64> {
    array(reader).map(|bytes| u64::from(u32::from_le_bytes(bytes)))
}

impl Container for Ros1 {
    fn topics(&self) -> &Topics {
        &self.topics
    }

    fn begin(&self) -> Option<i64> {
        self.begin
    }

    fn read(&mut self, wanted: &[Cell<bool>], each: &mut Each<'_>) -> Result<(), ImportError> {
        let mut file = BufReader::new(regular_file::open(&self.path).at(&self.path)?);
        let mut content_limit = ContentLimit::for_file(file.get_ref().metadata().at(&self.path)?.len());
        let mut end = 0;
        for at in &self.chunks {
            // Nested chunks would make the time grow with the square of the file size.
            if *at < end {
                let rule = format!("the index says that a chunk begins here, but the previous one ends at byte {end}");
                return Err(ImportError::at_part(&self.path, &format!("byte {at}"), rule));
            }
            end = self.chunk(&mut file, *at, wanted, each, &mut content_limit)?;
        }
        Ok(())
    }
}
