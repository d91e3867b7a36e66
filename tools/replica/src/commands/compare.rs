//! `replica compare`: where two recordings differ first, and by how much.

mod fields;

use anyhow::Context;
use fields::{Differences, FieldRule};
use formats::recording::{RecordedTopic, RecordingReader};
use messages::Envelope;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

/// Exit code of recordings that differ.
const DIFFERENT: u8 = 3;

/// Tells where two recordings differ first and by how much; clock fields are ignored. Exit code 0 equal, 3 different.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// A recording.
    a: PathBuf,
    /// Another.
    b: PathBuf,
    /// Topics to compare [default: all of both].
    #[arg(long, value_delimiter = ',')]
    topics: Vec<String>,
    /// Differences of a field that do not count, up to a value; e.g. score=1, or header.origin=1e-6 (may be repeated).
    #[arg(long = "tolerance", value_name = "FIELD=VALUE")]
    tolerances: Vec<Tolerance>,
}

/// `field=value`.
#[derive(Clone, Debug)]
struct Tolerance {
    field: String,
    value: f64,
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (field, value) = text.split_once('=').ok_or("must be FIELD=VALUE")?;
        let value = value.parse().ok().filter(|value: &f64| *value >= 0.0);
        let value = value.ok_or_else(|| format!("{text}: VALUE must be a number, 0 or more"))?;
        Ok(Self { field: field.to_owned(), value })
    }
}

/// Compares and prints; 3 if they differ.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let readers = [RecordingReader::open(&args.a)?, RecordingReader::open(&args.b)?];
    let mut names: Vec<String> = readers.iter().flat_map(|r| r.topics().iter().map(|t| t.name.clone())).collect();
    names.sort();
    names.dedup();
    if !args.topics.is_empty() {
        for topic in &args.topics {
            anyhow::ensure!(
                names.contains(topic),
                "topic {topic} is in neither recording; there are {}",
                names.join(", ")
            );
        }
        names.retain(|name| args.topics.iter().any(|topic| name == topic || *name == format!("{topic}.tick")));
    }
    let mut equal = true;
    for name in &names {
        let [a, b] = readers.each_ref().map(|reader| reader.topics().iter().find(|topic| topic.name == *name));
        let text = match (a, b) {
            (Some(a), Some(b)) if (a.table.version, a.table.layout) != (b.table.version, b.table.layout) => {
                equal = false;
                let of = |t: &RecordedTopic| format!("version {} layout {:016x}", t.table.version, t.table.layout);
                format!("{name}: {} in a, {} in b\n", of(a), of(b))
            }
            (Some(topic), Some(_)) => {
                let compared = compare_topic(args, topic)?;
                equal &= compared.is_equal();
                compared.text(name)
            }
            (a, _) => {
                equal = false;
                format!("{name}: only in {}\n", if a.is_some() { "a" } else { "b" })
            }
        };
        print!("{text}");
    }
    println!("{}", if equal { "equal" } else { "different" });
    Ok(if equal { ExitCode::SUCCESS } else { ExitCode::from(DIFFERENT) })
}

/// One topic of both files.
#[derive(Default)]
struct Compared {
    n_both: u64,
    n_different: u64,
    /// First number and how many, by file.
    alone: [Option<(u64, u64)>; 2],
    /// Where the first difference is and what it is.
    first: Option<String>,
    differences: Differences,
}

impl Compared {
    fn is_equal(&self) -> bool {
        self.n_different == 0 && self.alone == [None, None]
    }

    fn text(&self, name: &str) -> String {
        let mut text = format!("{name}: {} messages in both, {} differ\n", self.n_both, self.n_different);
        for (alone, file) in self.alone.iter().zip(["a", "b"]) {
            if let Some((first, n)) = alone {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "  {n} messages only in {file}, the first is {first}");
            }
        }
        if let Some(first) = &self.first {
            let _ = writeln!(text, "  first: {first}");
        }
        text + &self.differences.table()
    }
}

/// A file's messages of one topic, one at a time.
struct Messages {
    reader: RecordingReader,
    topic: String,
    envelope: Option<Envelope>,
    bytes: Vec<u8>,
}

impl Messages {
    fn open(path: &Path, topic: &str) -> anyhow::Result<Self> {
        let reader = RecordingReader::open(path)?;
        let mut messages = Self { reader, topic: topic.to_owned(), envelope: None, bytes: Vec::new() };
        messages.advance()?;
        Ok(messages)
    }

    fn advance(&mut self) -> anyhow::Result<()> {
        loop {
            let Some(message) = self.reader.next()? else {
                self.envelope = None;
                return Ok(());
            };
            if message.topic.name == self.topic {
                self.envelope = Some(message.envelope);
                self.bytes.clear();
                self.bytes.extend_from_slice(message.bytes);
                return Ok(());
            }
        }
    }
}

/// Reads both files once for this topic: whatever the order of topics in them, two messages are in memory.
fn compare_topic(args: &Args, topic: &RecordedTopic) -> anyhow::Result<Compared> {
    let open = |path: &Path| Messages::open(path, &topic.name).with_context(|| topic.name.clone());
    let mut files = [open(&args.a)?, open(&args.b)?];
    let mut compared = Compared::default();
    let tolerance = |field: &str| args.tolerances.iter().find(|t| t.field == field).map_or(0.0, |t| t.value);
    let rules = FieldRule::of_table(&topic.table, tolerance);
    loop {
        let alone = match [files[0].envelope, files[1].envelope] {
            [None, None] => return Ok(compared),
            [Some(a), Some(b)] if a.seq == b.seq => {
                compared.n_both += 1;
                let first = compared.differences.add(&rules, &topic.table, &files[0].bytes, &files[1].bytes);
                if let Some(first) = first {
                    compared.n_different += 1;
                    compared.first.get_or_insert_with(|| {
                        format!("message {} (stamp {}, tick {}) {first}", a.seq, a.stamp, a.tick)
                    });
                }
                files.iter_mut().try_for_each(Messages::advance)?;
                continue;
            }
            [Some(a), b] if b.is_none_or(|b| a.seq < b.seq) => 0,
            _ => 1,
        };
        let seq = files[alone].envelope.map_or(0, |envelope| envelope.seq);
        compared.alone[alone].get_or_insert((seq, 0)).1 += 1;
        files[alone].advance()?;
    }
}
