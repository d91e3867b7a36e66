//! A recording cut into ticks again, as the stages of the run saw them.

use super::{RecordingError, RecordingReader};
use messages::{Envelope, TickRow};
use std::collections::VecDeque;
use std::path::Path;

/// Ticks by which one topic may be ahead of another in the file. Recorders write tick by tick; a file in which more has
/// to wait is in another order, and would have to be held in memory.
const MAX_AHEAD: usize = 64;

/// A message of a tick.
#[derive(Clone, Debug)]
pub struct RecordedMessage {
    /// Its envelope.
    pub envelope: Envelope,
    /// Envelope, header and rows.
    pub bytes: Vec<u8>,
}

/// Everything of one tick, by topic in the order in which the topics were asked for.
#[derive(Clone, Debug)]
pub struct RecordedTick {
    /// The tick itself: number, barrier, drive time, end.
    pub row: TickRow,
    /// Messages by topic.
    pub messages: Vec<Vec<RecordedMessage>>,
}

/// Reads some topics of a recording tick by tick. It must begin with the run, and nothing may be missing.
pub struct TickReader {
    reader: RecordingReader,
    topics: Vec<Topic>,
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
    /// Opens the recording for these topics, all of which it must have.
    pub fn open(path: &Path, topics: &[&str]) -> Result<Self, RecordingError> {
        let reader = RecordingReader::open(path)?;
        for topic in topics {
            let has = |wanted: &dyn Fn(&super::RecordedTopic) -> bool| reader.topics().iter().any(wanted);
            if !has(&|t| t.name == *topic) || !has(&|t| t.ticks_of() == Some(topic)) {
                let names: Vec<&str> = reader.topics().iter().filter_map(|topic| topic.ticks_of()).collect();
                let rule = format!("has no topic {topic} with its ticks; it has {}", names.join(", "));
                return Err(RecordingError::foreign(path, rule));
            }
        }
        let topic = |name: &&str| Topic {
            name: (*name).to_owned(),
            ticks: VecDeque::new(),
            messages: VecDeque::new(),
            n_received: 0,
            n_ticks: 0,
        };
        Ok(Self { reader, topics: topics.iter().map(topic).collect(), ended: false, failed: false })
    }

    /// The recording itself.
    pub fn recording(&self) -> &RecordingReader {
        &self.reader
    }

    /// Whether the last tick has come; a recorder that was stopped before has not written it.
    pub fn ended(&self) -> bool {
        self.ended
    }

    /// The next tick that all topics have whole. `None` behind the last one; nothing comes after an error.
    #[expect(clippy::should_implement_trait, reason = "the same verb as the reader it is built on")]
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

    /// Takes in one message. `false` at the end of the file.
    fn advance(&mut self) -> Result<bool, RecordingError> {
        let Some(recorded) = self.reader.next()? else { return Ok(false) };
        let ticks_of = recorded.topic.ticks_of();
        let name = ticks_of.unwrap_or(&recorded.topic.name);
        let Some(topic) = self.topics.iter_mut().find(|topic| topic.name == name) else { return Ok(true) };
        let accepted = match recorded.tick_row() {
            Some(row) => topic.accept_tick(row),
            None if ticks_of.is_some() => Err(format!("a tick of {name} without its row")),
            None => topic.accept(RecordedMessage { envelope: recorded.envelope, bytes: recorded.bytes.to_vec() }),
        };
        accepted.map(|()| true).map_err(|rule| self.reader.damaged(rule))
    }

    fn take_tick(&mut self) -> Result<RecordedTick, RecordingError> {
        let mut agreed: Option<(TickRow, String)> = None;
        let mut messages = Vec::new();
        for topic in &mut self.topics {
            let Some(row) = topic.ticks.pop_front() else { continue };
            let (first, first_name) = agreed.get_or_insert_with(|| (row, topic.name.clone()));
            if (first.tick, first.barrier, first.end) != (row.tick, row.barrier, row.end) {
                let rule = format!("tick {}: {} and {first_name} disagree on what follows", first.tick, topic.name);
                return Err(self.reader.damaged(rule));
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
    fn accept(&mut self, message: RecordedMessage) -> Result<(), String> {
        let (name, seq, due) = (&self.name, message.envelope.seq, self.n_received);
        if seq != due {
            return Err(if due == 0 {
                format!("{name} begins with message {seq}: a recording must begin with its run")
            } else {
                format!("message {seq} of {name} comes when {due} is due: a message is missing")
            });
        }
        if self.messages.len() > MAX_AHEAD * MAX_AHEAD {
            return Err(format!("{} messages of {name} before the tick they belong to", self.messages.len()));
        }
        self.n_received += 1;
        self.messages.push_back(message);
        Ok(())
    }

    fn accept_tick(&mut self, row: TickRow) -> Result<(), String> {
        let (name, tick, due) = (&self.name, row.tick, self.n_ticks);
        if tick != due {
            return Err(if due == 0 {
                format!("{name} begins with tick {tick}: a recording must begin with its run")
            } else {
                format!("tick {tick} of {name} comes when {due} is due: a tick is missing")
            });
        }
        if row.n_published != self.n_received {
            let n_received = self.n_received;
            return Err(format!(
                "tick {tick} of {name} comes behind {n_received} messages, {} were published: a message is missing",
                row.n_published
            ));
        }
        if self.ticks.len() > MAX_AHEAD {
            return Err(format!(
                "{name} is more than {MAX_AHEAD} ticks ahead of another topic: the file is not in the order of ticks"
            ));
        }
        self.n_ticks += 1;
        self.ticks.push_back(row);
        Ok(())
    }
}
