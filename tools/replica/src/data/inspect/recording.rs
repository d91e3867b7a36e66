//! Topics and times of a recording.

use recording::{RecordingError, RecordingReader};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

#[derive(Default)]
struct TopicTotals {
    messages: u64,
    rows: u64,
    bytes: u64,
    /// Stamps of the first and the last message.
    stamps: Option<(i64, i64)>,
    ended: bool,
}

/// What a recording contains.
#[derive(Serialize)]
pub struct RecordingFacts {
    path: String,
    /// Metadata of the run, written by the recorder.
    about: BTreeMap<String, String>,
    topics: Vec<TopicFacts>,
    /// Where the file is cut off, if it is.
    cut: Option<String>,
    /// Whether it has the last tick of every topic.
    pub complete: bool,
}

#[derive(Serialize)]
struct TopicFacts {
    name: String,
    version: u32,
    messages: u64,
    rows: u64,
    bytes: u64,
    /// Stamps of the first and the last message, ns since the Unix epoch.
    stamps: Option<(i64, i64)>,
    ticks: u64,
    /// Whether it has the last tick.
    complete: bool,
}

impl RecordingFacts {
    /// Reads the whole recording.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut reader = RecordingReader::open(path)?;
        let mut counted: BTreeMap<String, TopicTotals> = BTreeMap::new();
        let cut = loop {
            match reader.next() {
                Ok(Some(message)) => {
                    let row = message.tick_row();
                    let count = counted.entry(message.topic.name.clone()).or_default();
                    count.messages += 1;
                    count.rows += u64::from(message.envelope.len);
                    count.bytes += message.bytes.len() as u64;
                    let stamp = message.envelope.stamp;
                    count.stamps =
                        Some(count.stamps.map_or((stamp, stamp), |(first, last)| (first.min(stamp), last.max(stamp))));
                    count.ended |= row.is_some_and(|row| row.end != 0);
                }
                Ok(None) => break None,
                Err(cut @ RecordingError::Cut { .. }) => break Some(cut.to_string()),
                Err(error) => return Err(error),
            }
        };
        let mut topics = Vec::new();
        for topic in reader.topics().iter().filter(|topic| topic.ticks_of().is_none()) {
            let own = counted.remove(&topic.name).unwrap_or_default();
            let ticks = counted.remove(&format!("{}.tick", topic.name)).unwrap_or_default();
            topics.push(TopicFacts {
                name: topic.name.clone(),
                version: topic.table.version,
                messages: own.messages,
                rows: own.rows,
                bytes: own.bytes,
                stamps: own.stamps,
                ticks: ticks.messages,
                complete: ticks.ended,
            });
        }
        Ok(Self {
            path: path.display().to_string(),
            about: reader.about().iter().map(|(key, value)| (key.clone(), value.clone())).collect(),
            complete: cut.is_none() && topics.iter().all(|topic| topic.complete),
            topics,
            cut,
        })
    }

    /// A table.
    pub fn table(&self) -> String {
        let mut text = format!("{}\n", self.path);
        // Writing to a string cannot fail.
        for (key, value) in &self.about {
            let _ = writeln!(text, "  {key}: {value}");
        }
        let _ = writeln!(
            text,
            "  topic             version  messages         rows        MB  from (s)              to (s)      ticks"
        );
        for topic in &self.topics {
            let (from, to) = topic.stamps.unwrap_or_default();
            let _ = writeln!(
                text,
                "  {:16}  {:>7}  {:>8}  {:>11}  {:>8.1}  {:<20.3}  +{:<9.3}  {}{}",
                topic.name,
                topic.version,
                topic.messages,
                topic.rows,
                topic.bytes as f64 * 1e-6,
                from as f64 * 1e-9,
                to.saturating_sub(from) as f64 * 1e-9,
                topic.ticks,
                if topic.complete { ", to the end" } else { ", not to the end" }
            );
        }
        if let Some(cut) = &self.cut {
            let _ = writeln!(text, "  {cut}");
        }
        let _ = writeln!(text, "  {}", if self.complete { "complete" } else { "not complete" });
        text
    }
}
