//! Reads a recording tick by tick, in the order in which the stages of the run received it.

use super::error::{ForeignFile, RecordFault, RecordingError};
use super::{RecordedTopic, RecordingReader};
use messages::{Envelope, TickRow};
use std::collections::VecDeque;
use std::path::Path;

/// Ticks by which one topic may be ahead of another in the file. Recorders write tick by tick. Other files are refused because they
/// would have to be held in memory.
const MAX_AHEAD: usize = 64;

/// A message of a tick.
#[derive(Clone, Debug)]
pub struct RecordedMessage {
    /// Envelope of the message.
    pub envelope: Envelope,
    /// Envelope, header and rows.
    pub bytes: Vec<u8>,
}

/// All messages of one tick, by topic in the order of the request.
#[derive(Clone, Debug)]
pub struct RecordedTick {
    /// Number, barrier, drive time and end flag of the tick.
    pub row: TickRow,
    /// Messages by topic.
    pub messages: Vec<Vec<RecordedMessage>>,
}

/// Reads some topics of a recording tick by tick. The recording must begin with the run and must be complete.
pub struct TickReader {
    reader: RecordingReader,
    topics: Vec<Topic>,
    /// Channels that were known before the first message was read.
    n_channels: usize,
    ended: bool,
    failed: bool,
}

struct Topic {
    name: String,
    ticks: VecDeque<TickRow>,
    messages: VecDeque<RecordedMessage>,
    n_received: u64,
    n_ticks: u64,
}

impl TickReader {
    /// Opens the recording. It must contain all these topics, at least one.
    pub fn open(path: &Path, topics: &[&str]) -> Result<Self, RecordingError> {
        let reader = RecordingReader::open(path)?;
        let found = || reader.topics().iter().filter_map(RecordedTopic::ticks_of).map(str::to_owned).collect();
        if topics.is_empty() {
            return Err(RecordingError::foreign(path, ForeignFile::NoTopicRequested { found: found() }));
        }
        for topic in topics {
            let has = |wanted: &dyn Fn(&RecordedTopic) -> bool| reader.topics().iter().any(wanted);
            if !has(&|t| t.name == *topic) || !has(&|t| t.ticks_of() == Some(topic)) {
                let reason = ForeignFile::MissingTopic { wanted: (*topic).to_owned(), found: found() };
                return Err(RecordingError::foreign(path, reason));
            }
        }
        let topic = |name: &&str| Topic {
            name: (*name).to_owned(),
            ticks: VecDeque::new(),
            messages: VecDeque::new(),
            n_received: 0,
            n_ticks: 0,
        };
        let n_channels = reader.topics().len();
        Ok(Self { reader, topics: topics.iter().map(topic).collect(), n_channels, ended: false, failed: false })
    }

    /// The underlying recording.
    pub fn recording(&self) -> &RecordingReader {
        &self.reader
    }

    /// Whether the last tick of the run was read. It is missing if the recorder was stopped before the run ended.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// The next tick that is complete for all topics. `None` after the last tick and after an error.
    #[expect(clippy::should_implement_trait, reason = "same name as RecordingReader::next")]
    pub fn next(&mut self) -> Result<Option<RecordedTick>, RecordingError> {
        while !self.failed && !self.ended {
            if self.topics.iter().all(|topic| !topic.ticks.is_empty()) {
                let tick = self.take_tick();
                self.failed = tick.is_err();
                return tick.map(Some);
            }
            match self.advance() {
                Ok(true) => {}
                other => {
                    self.failed = true;
                    return other.map(|_| None);
                }
            }
        }
        Ok(None)
    }

    /// Reads one message. `false` at the end of the file.
    fn advance(&mut self) -> Result<bool, RecordingError> {
        let Some(recorded) = self.reader.next()? else { return Ok(false) };
        let ticks_of = recorded.topic.ticks_of();
        if recorded.index >= self.n_channels {
            let late = ticks_of.unwrap_or(&recorded.topic.name).to_owned();
            return Err(self.reader.damaged(RecordFault::LateChannel(late)));
        }
        let name = ticks_of.unwrap_or(&recorded.topic.name);
        let Some(topic) = self.topics.iter_mut().find(|topic| topic.name == name) else { return Ok(true) };
        let accepted = match recorded.tick_row() {
            Some(row) => topic.accept_tick(row),
            None if ticks_of.is_some() => Err(RecordFault::EmptyTick(name.to_owned())),
            None => topic.accept(RecordedMessage { envelope: recorded.envelope, bytes: recorded.bytes.to_vec() }),
        };
        accepted.map(|()| true).map_err(|fault| self.reader.damaged(fault))
    }

    fn take_tick(&mut self) -> Result<RecordedTick, RecordingError> {
        let mut agreed: Option<(TickRow, String)> = None;
        let mut messages = Vec::new();
        for topic in &mut self.topics {
            let Some(row) = topic.ticks.pop_front() else { continue };
            let (first, first_name) = agreed.get_or_insert_with(|| (row, topic.name.clone()));
            if (first.tick, first.barrier, first.end) != (row.tick, row.barrier, row.end) {
                let tick = first.tick;
                let topic = topic.name.clone();
                let other = first_name.clone();
                return Err(self.reader.damaged(RecordFault::TickMismatch { tick, topic, other }));
            }
            let before = topic.messages.iter().take_while(|message| message.envelope.tick <= row.tick).count();
            messages.push(topic.messages.drain(..before).collect());
        }
        let (row, _) = agreed.unwrap_or_default();
        self.ended = row.end != 0;
        Ok(RecordedTick { row, messages })
    }
}

impl Topic {
    fn accept(&mut self, message: RecordedMessage) -> Result<(), RecordFault> {
        self.check_number("message", message.envelope.seq, self.n_received)?;
        if self.messages.len() > MAX_AHEAD * MAX_AHEAD {
            return Err(RecordFault::EarlyMessages { topic: self.name.clone(), n: self.messages.len() });
        }
        self.n_received += 1;
        self.messages.push_back(message);
        Ok(())
    }

    fn accept_tick(&mut self, row: TickRow) -> Result<(), RecordFault> {
        self.check_number("tick", row.tick, self.n_ticks)?;
        if row.n_published != self.n_received {
            let tick = row.tick;
            let found = self.n_received;
            let expected = row.n_published;
            return Err(RecordFault::MissingMessages { topic: self.name.clone(), tick, found, expected });
        }
        if self.ticks.len() > MAX_AHEAD {
            return Err(RecordFault::EarlyTicks { topic: self.name.clone(), limit: MAX_AHEAD });
        }
        self.n_ticks += 1;
        self.ticks.push_back(row);
        Ok(())
    }

    /// Whether a message or tick is the next one of the run.
    fn check_number(&self, what: &'static str, found: u64, expected: u64) -> Result<(), RecordFault> {
        let topic = || self.name.clone();
        match expected {
            _ if found == expected => Ok(()),
            0 => Err(RecordFault::LateBegin { topic: topic(), what, number: found }),
            _ => Err(RecordFault::Gap { topic: topic(), what, found, expected }),
        }
    }
}
