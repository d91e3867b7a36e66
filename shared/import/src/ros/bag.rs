//! Bags of ROS 1 and ROS 2: topics, and messages in the order of the file.

mod decompress;
mod folder;
mod mcap;
mod message_zstd;
mod record;
mod ros1;
mod sqlite;
mod topics;

pub(crate) use folder::METADATA;
pub(crate) use topics::{Encoding, Topic};

use crate::error::ImportError;
use folder::FolderFiles;
use std::cell::Cell;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use topics::Topics;

/// Longest message, bytes. A cloud of 600000 points has about 30 MB, an image of 8192 x 8192 pixels 201 MB.
const MAX_MESSAGE: u64 = 1 << 28;

/// Maximum number of topics of a bag. Large robots have some hundreds; each is compared with all others.
const MAX_TOPICS: usize = 4096;

/// A message of a bag.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Message<'a> {
    /// Index of the topic.
    pub topic: usize,
    /// Time of reception by the recorder, ns since the Unix epoch.
    pub received: i64,
    pub data: &'a [u8],
}

/// Receives messages.
type Each<'a> = dyn FnMut(Message<'_>) -> Result<(), ImportError> + 'a;

/// A file of a bag.
trait Container {
    fn topics(&self) -> &Topics;
    /// Start of the recording, ns since the Unix epoch, if the file states it before its messages.
    fn begin(&self) -> Option<i64> {
        None
    }
    /// Passes all messages of the topics marked in `wanted`, by their index, as long as they are marked.
    fn read(&mut self, wanted: &[Cell<bool>], each: &mut Each<'_>) -> Result<(), ImportError>;
}

/// A bag: one file, or the files of a folder.
pub(crate) struct Bag {
    parts: Vec<Box<dyn Container>>,
    topics: Topics,
    /// Topic of the bag, by part and topic of the part.
    topic_of_part: Vec<Vec<usize>>,
    files: Vec<PathBuf>,
    /// Whether each message is compressed.
    is_zstd: bool,
}

/// Container format of a file, detected from its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Ros1,
    Mcap,
    Sqlite,
}

impl Kind {
    fn from_file(path: &Path) -> io::Result<Option<Self>> {
        let mut begin = Vec::new();
        File::open(path)?.take(16).read_to_end(&mut begin)?;
        let kinds = [(Self::Ros1, &b"#ROSBAG V"[..]), (Self::Mcap, mcap::MAGIC), (Self::Sqlite, b"SQLite format 3\0")];
        Ok(kinds.into_iter().find(|(_, mark)| begin.starts_with(mark)).map(|(kind, _)| kind))
    }
}

/// Whether this is a bag or a folder that contains one.
pub(crate) fn is_bag(source: &Path) -> bool {
    if source.is_dir() { folder::is_bag(source) } else { matches!(Kind::from_file(source), Ok(Some(_))) }
}

impl Bag {
    /// Opens a bag and the further files of a recording that was split. Compressed files are decompressed to the folder `scratch`.
    pub fn open(source: &Path, more: &[PathBuf], scratch: &Path) -> Result<Self, ImportError> {
        let FolderFiles { mut files, is_zstd, in_order } = if source.is_dir() {
            folder::files(source)?
        } else {
            FolderFiles { files: vec![source.to_owned()], is_zstd: false, in_order: false }
        };
        files.extend(more.iter().cloned());
        let mut opened = Vec::new();
        for path in &files {
            let plain = folder::decompressed(path, scratch)?;
            opened.push((open(&plain)?, path.clone()));
        }
        // Names of split recordings may not be in the order of time.
        if !in_order || !more.is_empty() {
            opened.sort_by_key(|(part, _)| part.begin());
        }
        let mut parts = Vec::new();
        let mut topics = Topics::default();
        let mut topic_of_part = Vec::new();
        for (part, _) in &opened {
            topic_of_part.push(part.topics().list().iter().map(|topic| topics.merge(topic)).collect());
        }
        let mut files = Vec::new();
        for (part, path) in opened {
            parts.push(part);
            files.push(path);
        }
        let n_topics = topics.list().len();
        if n_topics > MAX_TOPICS {
            return Err(ImportError::at(source, format!("{n_topics} topics; at most {MAX_TOPICS} are read")));
        }
        Ok(Self { parts, topics, topic_of_part, files, is_zstd })
    }

    /// All topics, by name.
    pub fn topics(&self) -> &[Topic] {
        self.topics.list()
    }

    /// The files that are read.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Passes all messages of the topics marked in `wanted`, by their index, with their file. `each` returns whether it
    /// wants more messages of the topic.
    pub fn read(
        &mut self,
        mut wanted: Vec<bool>,
        mut each: impl FnMut(&Path, Message<'_>) -> Result<bool, ImportError>,
    ) -> Result<(), ImportError> {
        for ((part, topics), path) in self.parts.iter_mut().zip(&self.topic_of_part).zip(&self.files) {
            let wanted_of_part: Vec<Cell<bool>> = topics.iter().map(|topic| Cell::new(wanted[*topic])).collect();
            let is_zstd = self.is_zstd;
            part.read(&wanted_of_part, &mut |message| {
                let is_wanted = &wanted_of_part[message.topic];
                let message = Message { topic: topics[message.topic], ..message };
                let more = if is_zstd {
                    let data = message_zstd::decompressed(message.data).map_err(|rule| {
                        ImportError::at_part(path, &format!("message received at {}", message.received), rule)
                    })?;
                    each(path, Message { data: &data, ..message })?
                } else {
                    each(path, message)?
                };
                is_wanted.set(more);
                wanted[message.topic] = more;
                Ok(())
            })?;
        }
        Ok(())
    }
}

fn open(path: &Path) -> Result<Box<dyn Container>, ImportError> {
    let kind = Kind::from_file(path).map_err(|error| ImportError::at(path, error.to_string()))?;
    match kind {
        Some(Kind::Ros1) => Ok(Box::new(ros1::Ros1::open(path)?)),
        Some(Kind::Mcap) => Ok(Box::new(mcap::Mcap::open(path)?)),
        Some(Kind::Sqlite) => Ok(Box::new(sqlite::Sqlite::open(path)?)),
        None => Err(ImportError::at(path, "not a bag: begins neither as a ROS 1 bag nor as MCAP nor as SQLite")),
    }
}
