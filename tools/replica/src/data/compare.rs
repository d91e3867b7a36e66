//! `replica compare`: the first and the largest difference of two recordings; the classes of two segmenters.

mod classes;
mod fields;
mod message_reader;

use anyhow::Context;
use classes::ClassComparison;
use command_line::answer::Answer;
use command_line::argument::InvalidValue;
use command_line::exit_code;
use command_line::usage_error::UsageError;
use fields::{Differences, FieldRule};
use message_reader::MessageReader;
use recording::{RecordedTopic, RecordingReader};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

/// Compare two recordings, or the classes of two segmenters.
///
/// Recordings: reports the first difference of each topic and the largest difference of each field. Times of publication are
/// ignored. Recordings that do not reach the end of their run are compared up to the end of the shorter one.
///
/// Output folders of runs: reports for each class its points in both, and where the classes differ. For one run, compares
/// `class` with the columns of `export.further_classes`; for two runs with the same submaps, each column of both.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 equal and complete, 1 failed, 2 wrong usage, 3 different or not complete\n\n\
                  Example: replica compare a.mcap b.mcap --tolerance score=1")]
pub struct Args {
    /// First recording (.mcap), or output folder of a run
    a: PathBuf,
    /// Second recording (.mcap), or output folder of a run
    b: Option<PathBuf>,
    /// Topics to compare [default: all topics of both]; for one run, the first with each other one
    #[arg(long, value_delimiter = ',')]
    topics: Vec<String>,
    /// Largest difference of a field that is ignored, e.g. score=1 or header.origin=1e-6 (may be repeated)
    #[arg(long = "tolerance", value_name = "FIELD=VALUE")]
    tolerances: Vec<Tolerance>,
    #[command(flatten)]
    answer: Answer,
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
    let is_fine = if is_recording(&args.a) {
        let compared = Comparison::from_args(args)?;
        args.answer.print(&compared, || compared.text())?;
        compared.is_equal && compared.is_complete
    } else {
        let compared = ClassComparison::from_args(args)?;
        args.answer.print(&compared, || compared.text())?;
        compared.is_equal
    };
    Ok(if is_fine { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}

/// Whether a path is a recording: neither a folder of clouds nor a cloud.
fn is_recording(path: &Path) -> bool {
    !path.is_dir() && path.extension().is_none_or(|extension| extension != "ply")
}

/// The whole result.
#[derive(Serialize)]
struct Comparison {
    /// Whether no topic differs up to the end of the shorter recording.
    is_equal: bool,
    /// Whether both recordings reach the end of their run.
    is_complete: bool,
    /// Results by name of the topic.
    topics: BTreeMap<String, TopicResult>,
    /// Why a recording is not complete, by recording.
    faults: [BTreeSet<String>; 2],
}

/// Result of the comparison of a topic.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum TopicResult {
    /// Its messages have different layouts: version and layout in each recording.
    Layouts([String; 2]),
    /// Only one recording has it.
    OnlyIn(&'static str),
    Compared(TopicComparison),
}

/// The names of the recordings in the result.
const FILES: [&str; 2] = ["a", "b"];

impl Comparison {
    fn from_args(args: &Args) -> anyhow::Result<Self> {
        let Some(b) = &args.b else {
            return Err(UsageError("a recording needs a second one to be compared with".to_owned()).into());
        };
        let readers = [RecordingReader::open(&args.a)?, RecordingReader::open(b)?];
        let names = topic_names(args, &readers)?;
        let mut faults = readers.each_ref().map(|_| BTreeSet::new());
        if names.is_empty() {
            // A file that is cut before its first message has no topics.
            for (fault, reader) in faults.iter_mut().zip(readers.each_ref().map(RecordingReader::path)) {
                fault.extend(MessageReader::open(reader, "")?.cut);
            }
        }
        let mut topics = BTreeMap::new();
        for name in names {
            let found = readers.each_ref().map(|reader| reader.topics().iter().find(|topic| topic.name == name));
            let result = match found {
                [Some(a), Some(b)] if (a.table.version, a.table.layout) != (b.table.version, b.table.layout) => {
                    let of = |t: &RecordedTopic| format!("version {} layout {:016x}", t.table.version, t.table.layout);
                    TopicResult::Layouts([of(a), of(b)])
                }
                [Some(topic), Some(_)] => {
                    let compared = compare_topic(args, [&args.a, b], topic)?;
                    for (all, own) in faults.iter_mut().zip(&compared.faults) {
                        all.extend(own.clone());
                    }
                    TopicResult::Compared(compared)
                }
                [a, _] => TopicResult::OnlyIn(FILES[usize::from(a.is_none())]),
            };
            topics.insert(name, result);
        }
        let is_equal = |result: &TopicResult| matches!(result, TopicResult::Compared(topic) if topic.is_equal());
        Ok(Self {
            is_equal: topics.values().all(is_equal),
            is_complete: faults.iter().all(BTreeSet::is_empty),
            topics,
            faults,
        })
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (name, result) in &self.topics {
            // Writing to a string cannot fail.
            let _ = match result {
                TopicResult::Layouts([a, b]) => writeln!(text, "{name}: {a} in a, {b} in b"),
                TopicResult::OnlyIn(file) => writeln!(text, "{name}: only in {file}"),
                TopicResult::Compared(topic) => write!(text, "{}", topic.text(name)),
            };
        }
        for (file, faults) in FILES.iter().zip(&self.faults) {
            for fault in faults {
                let _ = writeln!(text, "{file} is not complete: {fault}");
            }
        }
        text + match (self.is_equal, self.is_complete) {
            (true, true) => "equal\n",
            (true, false) => "equal up to the end of the shorter one, but not complete\n",
            (false, _) => "different\n",
        }
    }
}

/// The topics to compare, sorted.
fn topic_names(args: &Args, readers: &[RecordingReader; 2]) -> anyhow::Result<BTreeSet<String>> {
    let mut names: BTreeSet<String> =
        readers.iter().flat_map(|reader| reader.topics().iter().map(|topic| topic.name.clone())).collect();
    if !args.topics.is_empty() {
        for topic in &args.topics {
            anyhow::ensure!(
                names.contains(topic),
                "topic {topic} is in neither recording; their topics are {}",
                names.iter().cloned().collect::<Vec<_>>().join(", ")
            );
        }
        names.retain(|name| args.topics.iter().any(|topic| name == topic || *name == format!("{topic}.tick")));
    }
    Ok(names)
}

/// The result for one topic.
#[derive(Default, Serialize)]
struct TopicComparison {
    /// Messages that both recordings have, and how many of them differ.
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
        for (unmatched, file) in self.unmatched.iter().zip(FILES) {
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

/// Reads both files once per topic: only two messages are in memory, whatever the order of the topics in the files.
fn compare_topic(args: &Args, paths: [&PathBuf; 2], topic: &RecordedTopic) -> anyhow::Result<TopicComparison> {
    let open = |path: &Path| MessageReader::open(path, &topic.name).with_context(|| topic.name.clone());
    let mut files = [open(paths[0])?, open(paths[1])?];
    let mut compared = TopicComparison::default();
    let tolerance = |field: &str| args.tolerances.iter().find(|t| t.field == field).map_or(0.0, |t| t.value);
    let rules = FieldRule::from_table(&topic.table, tolerance);
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
