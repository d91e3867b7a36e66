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
use files::calendar::text_of_nanos;
use files::regular_file;
use folder::FolderFiles;
use std::cell::Cell;
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
    /// Time of the first message, ns since the Unix epoch; `None` without messages.
    fn begin(&self) -> Option<i64>;
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
        regular_file::open(path)?.take(16).read_to_end(&mut begin)?;
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
        if in_order && more.is_empty() {
            check_order(&opened)?;
        } else {
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

/// Fails if the list of a recording names a file before one that begins earlier.
fn check_order(opened: &[(Box<dyn Container>, PathBuf)]) -> Result<(), ImportError> {
    let begins: Vec<(i64, &PathBuf)> =
        opened.iter().filter_map(|(part, path)| part.begin().map(|begin| (begin, path))).collect();
    let Some(pair) = begins.windows(2).find(|pair| pair[1].0 < pair[0].0) else { return Ok(()) };
    let [(before, first), (after, second)] = [pair[0], pair[1]];
    let text = |path: &Path, begin| {
        let size = path.metadata().map_or(0, |metadata| metadata.len());
        format!(
            "{} ({size} bytes, from {})",
            path.file_name().unwrap_or_default().to_string_lossy(),
            text_of_nanos(begin)
        )
    };
    let rule = format!(
        "{METADATA} lists {} before {}, which begins {:.3} s earlier: the clock of the recorder was set back, or the list is \
         wrong. Import each file on its own, or without {METADATA}: the first with --part for each other one",
        text(first, before),
        text(second, after),
        before.saturating_sub(after) as f64 * 1e-9
    );
    Err(ImportError::at(second, rule))
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// An MCAP file with a message at each of these times, ns.
    fn mcap(times: &[u64], has_summary: bool) -> Vec<u8> {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let record = |kind: u8, body: &[u8]| [&[kind][..], &(body.len() as u64).to_le_bytes(), body].concat();
        let channel = record(4, &[&[1, 0, 0, 0][..], &text("/imu"), &text("cdr"), &[0; 4]].concat());
        let mut file = [mcap::MAGIC, &channel].concat();
        for time in times {
            file.extend(record(
                5,
                &[&[1, 0, 0, 0, 0, 0][..], &time.to_le_bytes(), &time.to_le_bytes(), &[0, 1]].concat(),
            ));
        }
        file.extend(record(15, &[0; 4]));
        let summary = if has_summary { file.len() as u64 } else { 0 };
        if has_summary {
            let n = times.len() as u64;
            let first = times.iter().min().copied().unwrap_or_default();
            let counts = [&10_u32.to_le_bytes()[..], &1_u16.to_le_bytes(), &n.to_le_bytes()].concat();
            let span = [first.to_le_bytes(), first.to_le_bytes()].concat();
            file.extend(&channel);
            file.extend(record(11, &[&n.to_le_bytes()[..], &[0; 18], &span, &counts].concat()));
        }
        file.extend(record(2, &[&summary.to_le_bytes()[..], &[0; 12]].concat()));
        file.extend(mcap::MAGIC);
        file
    }

    fn received(bag: &mut Bag) -> Vec<i64> {
        let mut found = Vec::new();
        let add = |_: &Path, message: Message<'_>| {
            found.push(message.received);
            Ok(true)
        };
        bag.read(vec![true], add).expect("reads");
        found
    }

    #[test]
    fn parts_of_a_recording_are_read_in_the_order_of_their_times() {
        for has_summary in [false, true] {
            let folder = tempfile::tempdir().expect("a folder");
            let [later, earlier] = ["a_later.mcap", "b_earlier.mcap"].map(|name| folder.path().join(name));
            fs::write(&later, mcap(&[600, 601], has_summary)).expect("writes");
            fs::write(&earlier, mcap(&[1, 2], has_summary)).expect("writes");
            let mut bag = Bag::open(&later, &[earlier], folder.path()).expect("opens");
            assert_eq!(received(&mut bag), [1, 2, 600, 601]);
        }
    }

    #[test]
    fn list_of_files_that_contradicts_their_times_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let begin = 1_700_000_000_000_000_000;
        fs::write(folder.path().join("r_0.mcap"), mcap(&[begin + 600_000_000_000], true)).expect("writes");
        fs::write(folder.path().join("r_1.mcap"), mcap(&[begin], true)).expect("writes");
        let metadata = |names: [&str; 2]| {
            let list = names.map(|name| format!("    - {name}\n")).concat();
            let text = format!("rosbag2_bagfile_information:\n  relative_file_paths:\n{list}");
            fs::write(folder.path().join(METADATA), text).expect("writes");
            Bag::open(folder.path(), &[], folder.path())
        };
        let error = metadata(["r_0.mcap", "r_1.mcap"]).err().expect("is refused").to_string();
        let words = [
            "lists r_0.mcap (",
            "bytes, from 2023-11-14 22:23:20.000 UTC) before r_1.mcap (",
            "which begins 600.000 s earlier",
        ];
        assert!(words.iter().all(|words| error.contains(words)), "{error}");
        let mut bag = metadata(["r_1.mcap", "r_0.mcap"]).expect("opens");
        assert_eq!(received(&mut bag).len(), 2);
    }

    #[test]
    fn containers_of_a_recording_begin_at_the_same_time() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bags");
        let begin = |name: &str| {
            let bag = Bag::open(&folder.join(name), &[], Path::new("")).unwrap_or_else(|error| panic!("{error}"));
            bag.parts[0].begin()
        };
        assert!(begin("street.bag").is_some());
        for name in ["street_mcap", "street_sqlite"] {
            assert_eq!(begin(name), begin("street.bag"), "{name}");
        }
    }
}
