//! Reads the messages of one topic of a recording, one at a time.

use messages::Envelope;
use recording::{RecordingError, RecordingReader};
use std::path::Path;

/// A recording at a message of one topic.
pub struct MessageReader {
    recording: RecordingReader,
    topic: String,
    /// Envelope of the current message. `None` after the last one.
    pub envelope: Option<Envelope>,
    /// Envelope, header and rows of the current message.
    pub bytes: Vec<u8>,
    /// Where the file is cut, once the reader has reached that place.
    pub cut: Option<String>,
    /// The topic is a tick channel.
    has_ticks: bool,
    /// The last tick of the run was read.
    has_ended: bool,
}

impl MessageReader {
    /// Reads up to the first message of the topic.
    pub fn open(path: &Path, topic: &str) -> anyhow::Result<Self> {
        let recording = RecordingReader::open(path)?;
        let mut reader = Self {
            recording,
            topic: topic.to_owned(),
            envelope: None,
            bytes: Vec::new(),
            cut: None,
            has_ticks: false,
            has_ended: false,
        };
        reader.advance()?;
        let own = reader.recording.topics().iter().find(|own| own.name == topic);
        reader.has_ticks = own.is_some_and(|own| own.ticks_of().is_some());
        Ok(reader)
    }

    /// Reads the next message of the topic. A cut file ends before its cut.
    pub fn advance(&mut self) -> anyhow::Result<()> {
        loop {
            let message = match self.recording.next() {
                Ok(Some(message)) => message,
                Ok(None) => {
                    self.envelope = None;
                    return Ok(());
                }
                Err(cut @ RecordingError::Cut { .. }) => {
                    self.envelope = None;
                    self.cut = Some(cut.to_string());
                    return Ok(());
                }
                Err(error) => return Err(error.into()),
            };
            if message.topic.name == self.topic {
                self.has_ended |= message.tick_row().is_some_and(|row| row.end != 0);
                self.envelope = Some(message.envelope);
                self.bytes.clear();
                self.bytes.extend_from_slice(message.bytes);
                return Ok(());
            }
        }
    }

    /// After the last message: why the topic does not reach the end of the run.
    pub fn fault(&self) -> Option<String> {
        let is_open = self.has_ticks && !self.has_ended;
        self.cut.clone().or_else(|| is_open.then(|| format!("{} does not reach the end of the run", self.topic)))
    }
}
