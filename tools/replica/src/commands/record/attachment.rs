//! One topic of a running pipeline, taken tick by tick.

use ipc::{IpcError, Looking, Node, Observed, Observer};
use messages::TickRow;
use messages::pod::rows_from_bytes;
use stage::assignment::TopicChannels;
use std::collections::VecDeque;

/// How far a topic has been recorded; outlives the attempts of the run.
#[derive(Debug)]
pub struct Progress {
    name: String,
    /// The tick to be written next. `None`: none has been seen.
    next_tick: Option<u64>,
    /// The message to be written next.
    next_seq: u64,
    n_messages: u64,
    n_rows: u64,
    n_dropped: u64,
    /// Whether a tick has been written.
    begun: bool,
    ended: bool,
}

impl Progress {
    /// Nothing yet.
    pub fn new(name: String) -> Self {
        let (next_tick, next_seq, n_messages, n_rows, n_dropped) = (None, 0, 0, 0, 0);
        Self { name, next_tick, next_seq, n_messages, n_rows, n_dropped, begun: false, ended: false }
    }
    /// The topic.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// The tick to be written next, once one is known.
    pub fn next_tick(&self) -> Option<u64> {
        self.next_tick
    }
    /// Messages and ticks that passed by.
    pub fn n_dropped(&self) -> u64 {
        self.n_dropped
    }
    /// Whether the last tick is written.
    pub fn ended(&self) -> bool {
        self.ended
    }
    /// Before its first tick is written, a topic may be told to begin later, where others can too.
    pub fn begin_at(&mut self, tick: u64) {
        if !self.begun {
            self.next_tick = Some(tick);
        }
    }
}

impl std::fmt::Display for Progress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {} messages, {} rows", self.name, self.n_messages, self.n_rows)?;
        if self.n_dropped > 0 {
            write!(f, ", {} dropped", self.n_dropped)?;
        }
        Ok(())
    }
}

/// A whole tick.
pub struct Taken {
    /// The tick.
    pub row: TickRow,
    /// Its messages, in shared memory.
    pub messages: Vec<Observed>,
}

/// The observers of a topic in one attempt of the run.
pub struct Attachment {
    messages: Observer,
    ticks: Observer,
    /// Messages that wait for their tick to be whole.
    pending: VecDeque<Observed>,
    row: Option<TickRow>,
    /// Number behind the last message that came.
    received: u64,
}

impl Attachment {
    /// Attaches to both channels.
    pub fn open(node: &Node, channels: &TopicChannels, looking: Looking) -> Result<Self, IpcError> {
        Ok(Self {
            messages: Observer::open(node, &channels.messages, looking)?,
            ticks: Observer::open(node, &channels.ticks, looking)?,
            pending: VecDeque::new(),
            row: None,
            received: 0,
        })
    }

    /// Whether all producers are there and know of us.
    pub fn connect_all(attachments: &mut [Self]) -> Result<bool, IpcError> {
        let mut all = true;
        for attachment in attachments {
            all &= attachment.messages.connect()? & attachment.ticks.connect()?;
        }
        Ok(all)
    }

    /// Takes what has come. `false`: nothing.
    pub fn gather(&mut self, topic: &mut Progress, may_drop: bool) -> anyhow::Result<bool> {
        let mut anything = false;
        if self.row.is_none()
            && let Some(message) = self.ticks.receive()?
        {
            anything = true;
            let row = rows_from_bytes::<TickRow>(message.rows()).and_then(|rows| rows.first().copied());
            self.row = row;
        }
        anything |= self.gather_messages(topic)?;
        if let Some(row) = self.row {
            match topic.next_tick {
                None if row.tick == 0 && self.has_all_of_first(row) => topic.next_tick = Some(0),
                // Of the first tick something may have gone by before we came.
                None => topic.next_tick = Some(row.tick + 1),
                Some(next) if row.tick > next && may_drop => {
                    topic.n_dropped += row.tick - next;
                    topic.next_tick = Some(row.tick);
                    // Messages whose tick went by have none to be written with; behind them there may be more of this one.
                    self.forget_before(row.tick);
                    self.gather_messages(topic)?;
                }
                Some(next) if row.tick > next => {
                    anyhow::bail!("{}: tick {} came when {next} was due: the recording has a gap", topic.name, row.tick)
                }
                Some(_) => {}
            }
            if topic.next_tick.is_some_and(|next| row.tick < next) {
                self.row = None;
                self.forget_before(row.tick + 1);
                if !topic.begun {
                    topic.next_seq = row.n_published;
                }
            }
        }
        Ok(anything)
    }

    /// Takes messages. `false`: there were none, or no place for them.
    fn gather_messages(&mut self, topic: &Progress) -> Result<bool, IpcError> {
        let mut anything = false;
        // No more than a queue's length waits here; a tick has no more than that.
        while self.pending.len() < self.messages.channel().queue {
            let Some(message) = self.messages.receive()? else { break };
            anything = true;
            self.received = message.envelope().seq + 1;
            // After a restart what is written already comes again.
            if topic.next_tick.is_none_or(|next| message.envelope().tick >= next) {
                self.pending.push_back(message);
            }
        }
        Ok(anything)
    }

    fn forget_before(&mut self, tick: u64) {
        while self.pending.front().is_some_and(|message| message.envelope().tick < tick) {
            self.pending.pop_front();
        }
    }

    /// Messages of a tick are sent before it, so the first of all is here by now or went by before we came.
    fn has_all_of_first(&self, row: TickRow) -> bool {
        row.n_published == 0 || self.pending.front().is_some_and(|message| message.envelope().seq == 0)
    }

    /// Whether everything of the topic's next tick is here.
    pub fn is_whole(&self, topic: &Progress) -> bool {
        let due = topic.next_tick;
        self.row.is_some_and(|row| Some(row.tick) == due && self.received.max(topic.next_seq) >= row.n_published)
    }

    /// Takes the topic's next tick out.
    pub fn take_tick(&mut self, topic: &mut Progress, may_drop: bool) -> anyhow::Result<Option<Taken>> {
        let Some(row) = self.row.take() else { return Ok(None) };
        let n = self.pending.iter().take_while(|message| message.envelope().tick <= row.tick).count();
        let messages: Vec<Observed> = self.pending.drain(..n).collect();
        for message in &messages {
            let (seq, due) = (message.envelope().seq, topic.next_seq);
            anyhow::ensure!(
                seq == due || (may_drop && seq > due),
                "{}: message {seq} came when {due} was due: the recording has a gap",
                topic.name
            );
            topic.n_dropped += seq - due;
            topic.next_seq = seq + 1;
            topic.n_messages += 1;
            topic.n_rows += u64::from(message.envelope().len);
        }
        let (next, expected) = (topic.next_seq, row.n_published);
        anyhow::ensure!(
            next == expected || (may_drop && next < expected),
            "{}: after tick {} message {next} is due, {expected} were published: the recording has a gap",
            topic.name,
            row.tick
        );
        topic.n_dropped += expected - next;
        topic.next_seq = expected;
        topic.next_tick = Some(row.tick + 1);
        topic.begun = true;
        topic.ended = row.end != 0;
        Ok(Some(Taken { row, messages }))
    }
}
