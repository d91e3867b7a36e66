//! The observers of one topic, which collect whole ticks.

use super::progress::Progress;
use ipc::{IpcError, Node, Observed, Observer, ObserverMode};
use messages::TickRow;
use messages::pod::rows_from_bytes;
use run::assignment::TopicChannels;
use std::collections::VecDeque;

/// A tick with all its messages.
pub struct CompleteTick {
    /// The tick.
    pub row: TickRow,
    /// Its messages, in shared memory.
    pub messages: Vec<Observed>,
}

/// The observers of a topic in one attempt of the run.
pub struct Attachment {
    messages: Observer,
    ticks: Observer,
    /// Messages of ticks that are not complete yet.
    pending: VecDeque<Observed>,
    row: Option<TickRow>,
    /// Sequence number after the last received message.
    received: u64,
}

impl Attachment {
    /// Attaches to both channels.
    pub fn open(node: &Node, channels: &TopicChannels, mode: ObserverMode) -> Result<Self, IpcError> {
        Ok(Self {
            messages: Observer::open(node, &channels.messages, mode)?,
            ticks: Observer::open(node, &channels.ticks, mode)?,
            pending: VecDeque::new(),
            row: None,
            received: 0,
        })
    }

    /// Whether all producers exist and know the observers.
    pub fn connect_all(attachments: &mut [Self]) -> Result<bool, IpcError> {
        let mut all = true;
        for attachment in attachments {
            all &= attachment.messages.connect()? & attachment.ticks.connect()?;
        }
        Ok(all)
    }

    /// Receives messages. `false` if no message was waiting.
    pub fn receive(&mut self, topic: &mut Progress, may_drop: bool) -> anyhow::Result<bool> {
        let mut any = false;
        if self.row.is_none()
            && let Some(message) = self.ticks.receive()?
        {
            any = true;
            let row = rows_from_bytes::<TickRow>(message.rows()).and_then(|rows| rows.first().copied());
            self.row = row;
        }
        any |= self.receive_messages(topic)?;
        if let Some(row) = self.row {
            match topic.next_tick {
                None if row.tick == 0 && self.is_first_tick_complete(row) => topic.next_tick = Some(0),
                // Messages of this tick may have been published before the observer was attached.
                None => topic.next_tick = Some(row.tick + 1),
                Some(next) if row.tick > next && may_drop => {
                    topic.n_dropped += row.tick - next;
                    topic.next_tick = Some(row.tick);
                    // Messages of dropped ticks cannot be written. They may precede messages of this tick in the queue.
                    self.discard_before(row.tick);
                    self.receive_messages(topic)?;
                }
                Some(next) if row.tick > next => {
                    anyhow::bail!(
                        "{}: received tick {}, expected {next}: the recording has a gap",
                        topic.name,
                        row.tick
                    )
                }
                Some(_) => {}
            }
            if topic.next_tick.is_some_and(|next| row.tick < next) {
                self.row = None;
                self.discard_before(row.tick + 1);
                if !topic.begun {
                    topic.next_seq = row.n_published;
                }
            }
        }
        Ok(any)
    }

    /// Receives messages. `false` if no message was waiting, or if there is no space.
    fn receive_messages(&mut self, topic: &Progress) -> Result<bool, IpcError> {
        let mut any = false;
        // A tick never has more messages than the queue holds.
        while self.pending.len() < self.messages.channel().queue {
            let Some(message) = self.messages.receive()? else { break };
            any = true;
            self.received = message.envelope().seq + 1;
            // After a restart, messages that are already written arrive again.
            if topic.next_tick.is_none_or(|next| message.envelope().tick >= next) {
                self.pending.push_back(message);
            }
        }
        Ok(any)
    }

    fn discard_before(&mut self, tick: u64) {
        while self.pending.front().is_some_and(|message| message.envelope().tick < tick) {
            self.pending.pop_front();
        }
    }

    /// Messages of a tick are published before its tick row. So the first message is already here, or it was published before the
    /// observer was attached.
    fn is_first_tick_complete(&self, row: TickRow) -> bool {
        row.n_published == 0 || self.pending.front().is_some_and(|message| message.envelope().seq == 0)
    }

    /// Whether all messages of the topic's next tick are here.
    pub fn has_complete_tick(&self, topic: &Progress) -> bool {
        let due = topic.next_tick;
        self.row.is_some_and(|row| Some(row.tick) == due && self.received.max(topic.next_seq) >= row.n_published)
    }

    /// Removes and returns the topic's next tick.
    pub fn take_tick(&mut self, topic: &mut Progress, may_drop: bool) -> anyhow::Result<Option<CompleteTick>> {
        let Some(row) = self.row.take() else { return Ok(None) };
        let n = self.pending.iter().take_while(|message| message.envelope().tick <= row.tick).count();
        let messages: Vec<Observed> = self.pending.drain(..n).collect();
        for message in &messages {
            let seq = message.envelope().seq;
            let due = topic.next_seq;
            anyhow::ensure!(
                seq == due || (may_drop && seq > due),
                "{}: received message {seq}, expected {due}: the recording has a gap",
                topic.name
            );
            topic.n_dropped += seq - due;
            topic.next_seq = seq + 1;
            topic.n_messages += 1;
            topic.n_rows += u64::from(message.envelope().len);
        }
        let next = topic.next_seq;
        let expected = row.n_published;
        anyhow::ensure!(
            next == expected || (may_drop && next < expected),
            "{}: received {next} messages up to tick {}, {expected} were published: the recording has a gap",
            topic.name,
            row.tick
        );
        topic.n_dropped += expected - next;
        topic.next_seq = expected;
        topic.next_tick = Some(row.tick + 1);
        topic.begun = true;
        topic.ended = row.end != 0;
        Ok(Some(CompleteTick { row, messages }))
    }
}
