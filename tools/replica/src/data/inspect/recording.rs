//! Topics and times of a recording.

use formats::recording::{RecordingError, RecordingReader};
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

/// The table, and whether the recording is complete: it has the last tick of every topic.
pub fn table(path: &Path) -> Result<(String, bool), RecordingError> {
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
            Err(cut @ RecordingError::Cut { .. }) => break Some(cut),
            Err(error) => return Err(error),
        }
    };
    let mut text = format!("{}\n", path.display());
    // Writing to a string cannot fail.
    for (key, value) in reader.about() {
        let _ = writeln!(text, "  {key}: {value}");
    }
    let _ = writeln!(
        text,
        "  topic             version  messages         rows        MB  from (s)              to (s)      ticks"
    );
    let mut complete = cut.is_none();
    for topic in reader.topics().iter().filter(|topic| topic.ticks_of().is_none()) {
        let none = TopicTotals::default();
        let of = |name: &str| counted.get(name).unwrap_or(&none);
        let (own, ticks) = (of(&topic.name), of(&format!("{}.tick", topic.name)));
        complete &= ticks.ended;
        let (from, to) = own.stamps.unwrap_or_default();
        let _ = writeln!(
            text,
            "  {:16}  {:>7}  {:>8}  {:>11}  {:>8.1}  {:<20.3}  +{:<9.3}  {}{}",
            topic.name,
            topic.table.version,
            own.messages,
            own.rows,
            own.bytes as f64 * 1e-6,
            from as f64 * 1e-9,
            to.saturating_sub(from) as f64 * 1e-9,
            ticks.messages,
            if ticks.ended { ", to the end" } else { ", not to the end" }
        );
    }
    if let Some(cut) = cut {
        let _ = writeln!(text, "  {cut}");
    }
    let _ = writeln!(text, "  {}", if complete { "complete" } else { "not complete" });
    Ok((text, complete))
}
