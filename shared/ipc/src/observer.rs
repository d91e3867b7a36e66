//! Observes a topic without its type and without being one of its consumers.

use crate::message_subscriber::MessageSubscriber;
use crate::slot::{LINE, ReceivedSlot, bytes_of_lines};
use crate::{Channel, IpcError, LatestPublisher, NOTHING_TAKEN, Node, Waker};
use messages::Envelope;

/// Whether the producer waits for the observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObserverMode {
    /// The producer never waits: a message that does not fit the observer's queue is dropped. Gaps in `seq` show it.
    Dropping,
    /// The producer waits, as for a consumer: the observer receives every message from its first one on. One such
    /// observer at a time.
    Lossless,
}

/// Receives the messages of a topic as bytes.
pub struct Observer {
    channel: Channel,
    subscriber: MessageSubscriber,
    lossless: Option<Acknowledging>,
}

/// The acknowledgements of a lossless observer to the producer.
struct Acknowledging {
    acknowledgement: LatestPublisher,
    producer: Waker,
    taken: u64,
    /// Whether its queue was empty after the producer had registered it. Earlier messages may overrun the queue, so all
    /// of them are dropped.
    settled: bool,
}

impl Acknowledging {
    fn publish(&self) -> Result<(), IpcError> {
        self.acknowledgement.publish(&self.taken.to_le_bytes())
    }

    fn take(&mut self, seq: u64) -> Result<(), IpcError> {
        self.taken = seq + 1;
        self.publish()?;
        self.producer.wake();
        Ok(())
    }
}

impl Observer {
    /// Attaches to a topic of a run. Fails if the run does not exist or has too many observers already.
    pub fn open(node: &Node, channel: &Channel, mode: ObserverMode) -> Result<Self, IpcError> {
        let subscriber = MessageSubscriber::open(node, channel, "observer")?;
        let lossless = match mode {
            ObserverMode::Dropping => None,
            ObserverMode::Lossless => Some(Acknowledging {
                acknowledgement: LatestPublisher::open(node, &channel.observer_acknowledgement())?,
                producer: node.open_waker(&channel.producer)?,
                taken: NOTHING_TAKEN,
                settled: false,
            }),
        };
        let mut observer = Self { channel: channel.clone(), subscriber, lossless };
        observer.connect()?;
        Ok(observer)
    }

    /// The topic's channel.
    pub fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Whether the producer is connected and, if the observer is lossless, has registered it. Messages sent before may
    /// be missing; a lossless observer drops the others.
    pub fn connect(&mut self) -> Result<bool, IpcError> {
        let mut is_there = self.subscriber.connect(&self.channel)?;
        if let Some(lossless) = &mut self.lossless {
            // A latest value reaches only connected readers: it is published again until the producer is connected.
            lossless.publish()?;
            is_there &= lossless.acknowledgement.has_reader();
            if is_there && !lossless.settled {
                while take(&self.channel, &self.subscriber)?.is_some() {
                    lossless.publish()?;
                    lossless.producer.wake();
                }
                lossless.settled = true;
            }
        }
        Ok(is_there)
    }

    /// The next message, if there is one.
    pub fn receive(&mut self) -> Result<Option<Observed>, IpcError> {
        if self.lossless.as_ref().is_some_and(|lossless| !lossless.settled) && !self.connect()? {
            return Ok(None);
        }
        let Some(slot) = take(&self.channel, &self.subscriber)? else {
            if let Some(lossless) = &self.lossless {
                lossless.publish()?;
            }
            return Ok(None);
        };
        if let Some(lossless) = &mut self.lossless {
            lossless.take(slot.envelope().seq)?;
        }
        let observed = Observed { header_bytes: self.channel.header_bytes, row_bytes: self.channel.row_bytes, slot };
        let bytes = size_of_val(observed.slot.lines());
        let len = observed.envelope().len as usize;
        if observed.rows_at() + len * observed.row_bytes > bytes {
            let service = self.channel.name.clone();
            return Err(IpcError::Torn { service, bytes, len, row_bytes: observed.row_bytes });
        }
        Ok(Some(observed))
    }
}

fn take(channel: &Channel, subscriber: &MessageSubscriber) -> Result<Option<ReceivedSlot>, IpcError> {
    subscriber.receive().map_err(|cause| IpcError::transport(format!("observing {}", channel.name), cause))
}

/// A message as bytes, in shared memory.
pub struct Observed {
    slot: ReceivedSlot,
    header_bytes: usize,
    row_bytes: usize,
}

impl Observed {
    /// The envelope.
    pub fn envelope(&self) -> &Envelope {
        self.slot.envelope()
    }
    fn rows_at(&self) -> usize {
        self.header_bytes.next_multiple_of(LINE)
    }
    /// Bytes of the fixed part.
    pub fn header(&self) -> &[u8] {
        &bytes_of_lines(self.slot.lines())[..self.header_bytes]
    }
    /// Bytes of the rows.
    pub fn rows(&self) -> &[u8] {
        let rows_at = self.rows_at();
        &bytes_of_lines(self.slot.lines())[rows_at..rows_at + self.envelope().len as usize * self.row_bytes]
    }
}
