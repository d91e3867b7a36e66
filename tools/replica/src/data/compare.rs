//! `replica compare`: the first and the largest difference of two recordings.

mod fields;
mod message_reader;

use crate::argument::InvalidValue;
use crate::exit_code;
use crate::terminal::say;
use anyhow::Context;
use fields::{Differences, FieldRule};
use formats::recording::{RecordedTopic, RecordingReader};
use message_reader::MessageReader;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

/// Compare two recordings.
///
/// Reports the first difference of each topic and the largest difference of each field. Times of publication are ignored.
/// Recordings that do not reach the end of their run are compared as far as both go.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 equal and complete, 1 failed, 2 wrong usage, 3 different or not complete")]
pub struct Args {
    /// First recording (.mcap)
    a: PathBuf,
    /// Second recording (.mcap)
    b: PathBuf,
    /// Topics to compare [default: all topics of both]
    #[arg(long, value_delimiter = ',')]
    topics: Vec<String>,
    /// Largest difference of a field that is ignored, e.g. score=1 or header.origin=1e-6 (may be repeated)
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
    type Err = InvalidValue;

    fn from_str(text: &str) -> Result<Self, InvalidValue> {
        let parsed = text.split_once('=').and_then(|(field, value)| Some((field, value.parse().ok()?)));
        let (field, value) = parsed
            .filter(|(_, value): &(&str, f64)| *value >= 0.0)
            .ok_or(InvalidValue("FIELD=VALUE, VALUE 0 or above"))?;
        Ok(Self { field: field.to_owned(), value })
    }
}

/// Compares the recordings and prints the result.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let readers = [RecordingReader::open(&args.a)?, RecordingReader::open(&args.b)?];
    let mut names: Vec<String> = readers.iter().flat_map(|r| r.topics().iter().map(|t| t.name.clone())).collect();
    names.sort();
    names.dedup();
    if !args.topics.is_empty() {
        for topic in &args.topics {
            anyhow::ensure!(
                names.contains(topic),
                "topic {topic} is in neither recording; their topics are {}",
                names.join(", ")
            );
        }
        names.retain(|name| args.topics.iter().any(|topic| name == topic || *name == format!("{topic}.tick")));
    }
    let mut equal = true;
    let mut faults = readers.each_ref().map(|_| BTreeSet::new());
    if names.is_empty() {
        // A file that is cut before its first message has no topics.
        for (fault, reader) in faults.iter_mut().zip(readers.each_ref().map(RecordingReader::path)) {
            fault.extend(MessageReader::open(reader, "")?.cut);
        }
    }
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
                for (all, own) in faults.iter_mut().zip(&compared.faults) {
                    all.extend(own.clone());
                }
                compared.text(name)
            }
            (a, _) => {
                equal = false;
                format!("{name}: only in {}\n", if a.is_some() { "a" } else { "b" })
            }
        };
        say!("{}", text.trim_end())?;
    }
    for (file, faults) in ["a", "b"].iter().zip(&faults) {
        for fault in faults {
            say!("{file} is not complete: {fault}")?;
        }
    }
    let complete = faults.iter().all(BTreeSet::is_empty);
    say!(
        "{}",
        match (equal, complete) {
            (true, true) => "equal",
            (true, false) => "equal as far as both go, but not complete",
            (false, _) => "different",
        }
    )?;
    Ok(if equal && complete { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}

/// The result for one topic.
#[derive(Default)]
struct TopicComparison {
    n_both: u64,
    n_different: u64,
    /// Messages that only one file has: the first sequence number and the count, by file.
    unmatched: [Option<(u64, u64)>; 2],
    /// Place and values of the first difference.
    first: Option<String>,
    differences: Differences,
    /// Why the topic does not reach the end of the run, by file.
    faults: [Option<String>; 2],
}

impl TopicComparison {
    fn is_equal(&self) -> bool {
        self.n_different == 0 && self.unmatched == [None, None]
    }

    fn text(&self, name: &str) -> String {
        let mut text = format!("{name}: {} messages in both, {} differ\n", self.n_both, self.n_different);
        for (unmatched, file) in self.unmatched.iter().zip(["a", "b"]) {
            if let Some((first, n)) = unmatched {
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

/// Reads both files once per topic: only two messages are in memory, in whatever order the topics are in the files.
fn compare_topic(args: &Args, topic: &RecordedTopic) -> anyhow::Result<TopicComparison> {
    let open = |path: &Path| MessageReader::open(path, &topic.name).with_context(|| topic.name.clone());
    let mut files = [open(&args.a)?, open(&args.b)?];
    let mut compared = TopicComparison::default();
    let tolerance = |field: &str| args.tolerances.iter().find(|t| t.field == field).map_or(0.0, |t| t.value);
    let rules = FieldRule::of_table(&topic.table, tolerance);
    loop {
        let only_in = match [files[0].envelope, files[1].envelope] {
            [None, None] => {
                compared.faults = files.map(|file| file.fault());
                return Ok(compared);
            }
            [Some(a), Some(b)] if a.seq == b.seq => {
                compared.n_both += 1;
                let first = compared.differences.add(&rules, &topic.table, &files[0].bytes, &files[1].bytes);
                if let Some(first) = first {
                    compared.n_different += 1;
                    compared.first.get_or_insert_with(|| {
                        format!("message {} (stamp {}, tick {}) {first}", a.seq, a.stamp, a.tick)
                    });
                }
                files.iter_mut().try_for_each(MessageReader::advance)?;
                continue;
            }
            [Some(a), b] if b.is_none_or(|b| a.seq < b.seq) => 0,
            _ => 1,
        };
        let seq = files[only_in].envelope.map_or(0, |envelope| envelope.seq);
        compared.unmatched[only_in].get_or_insert((seq, 0)).1 += 1;
        files[only_in].advance()?;
    }
}
