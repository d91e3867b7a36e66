//! Recordings of labeled clouds, as `replica import` writes them: each submap is followed by its true classes.

use anyhow::Context;
use messages::pod::{Pod, rows_from_bytes};
use messages::{ClassTopic, Message, SubmapTopic};
use recording::RecordingReader;

/// Whether the recording has messages of a topic.
pub fn has_topic(reader: &RecordingReader, topic: &str) -> bool {
    reader.topics().iter().any(|known| known.name == topic)
}

/// Whether the classes of the recording are the truth rather than predictions of a run.
pub fn has_true_classes(reader: &RecordingReader) -> bool {
    let is_imported = reader.about().contains_key("imported");
    is_imported && has_topic(reader, SubmapTopic::TOPIC) && has_topic(reader, ClassTopic::TOPIC)
}

/// The rows of a recorded message.
pub fn rows<T: Pod>(bytes: &[u8]) -> anyhow::Result<Vec<T>> {
    rows_from_bytes(bytes).context("the recording was written by another version")
}
