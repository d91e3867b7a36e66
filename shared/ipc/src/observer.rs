//! Looking on at a topic without knowing its type, and without being one of its consumers.

use crate::channel::MessageService;
use crate::loan::{CacheLine, LINE, WireEnvelope, bytes_of_lines};
use crate::publisher::NOTHING_TAKEN;
use crate::{Channel, Iox, IpcError, LatestPublisher, Node, Waker};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, subscriber};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use messages::Envelope;

/// Whether the producer waits for the observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looking {
    /// Never: what does not fit the observer's queue passes it by. Gaps in `seq` tell.
    Dropping,
    /// As for a consumer: from the first message that it takes on, it misses none. One such observer at a time.
    Lossless,
}

/// Sees the messages of a topic as bytes.
pub struct Observer {
    channel: Channel,
    service: MessageService,
    subscriber: subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>,
    lossless: Option<Acknowledging>,
}

/// How a lossless observer keeps the producer informed.
struct Acknowledging {
    acknowledgement: LatestPublisher,
    producer: Waker,
    taken: u64,
    /// Whether its queue was empty since the producer has known of it. What is sent before may overrun the queue, so none
    /// of that is taken on.
    settled: bool,
}

impl Acknowledging {
    fn say(&self) -> Result<(), IpcError> {
        self.acknowledgement.publish(&self.taken.to_le_bytes())
    }

    fn take(&mut self, seq: u64) -> Result<(), IpcError> {
        self.taken = seq + 1;
        self.say()?;
        self.producer.ring();
        Ok(())
    }
}

impl Observer {
    /// Attaches to a topic of a run. Fails if the run is not there or too many look on already.
    pub fn open(node: &Node, channel: &Channel, looking: Looking) -> Result<Self, IpcError> {
        let service = channel.open(node)?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(channel.queue)
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|cause| IpcError::transport(format!("observer of {}", channel.name), cause))?;
        let lossless = match looking {
            Looking::Dropping => None,
            Looking::Lossless => Some(Acknowledging {
                acknowledgement: LatestPublisher::open(node, &channel.observer_acknowledgement())?,
                producer: Waker::open(node, &channel.producer)?,
                taken: NOTHING_TAKEN,
                settled: false,
            }),
        };
        let mut observer = Self { channel: channel.clone(), service, subscriber, lossless };
        observer.connect()?;
        Ok(observer)
    }

    /// The topic's channel.
    pub fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Whether the producer is there and, if the observer is lossless, knows of it. Messages sent before may be missing; a
    /// lossless observer drops those that are not.
    pub fn connect(&mut self) -> Result<bool, IpcError> {
        self.subscriber
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting to {}", self.channel.name), cause))?;
        let mut there = self.service.dynamic_config().number_of_publishers() > 0;
        if let Some(lossless) = &mut self.lossless {
            // A latest value reaches only those who were there: it is said again until they are.
            lossless.say()?;
            there &= lossless.acknowledgement.has_reader();
            if there && !lossless.settled {
                while take(&self.channel, &self.subscriber)?.is_some() {
                    lossless.say()?;
                    lossless.producer.ring();
                }
                lossless.settled = true;
            }
        }
        Ok(there)
    }

    /// The next message, if there is one.
    pub fn receive(&mut self) -> Result<Option<Observed>, IpcError> {
        if self.lossless.as_ref().is_some_and(|lossless| !lossless.settled) && !self.connect()? {
            return Ok(None);
        }
        let Some(sample) = take(&self.channel, &self.subscriber)? else {
            if let Some(lossless) = &self.lossless {
                lossless.say()?;
            }
            return Ok(None);
        };
        if let Some(lossless) = &mut self.lossless {
            lossless.take(sample.user_header().0.seq)?;
        }
        let observed = Observed { header_bytes: self.channel.header_bytes, row_bytes: self.channel.row_bytes, sample };
        let (bytes, len) = (size_of_val(observed.sample.payload()), observed.envelope().len as usize);
        if observed.rows_at() + len * observed.row_bytes > bytes {
            let service = self.channel.name.clone();
            return Err(IpcError::Torn { service, bytes, len, row_bytes: observed.row_bytes });
        }
        Ok(Some(observed))
    }
}

type MessageSample = Sample<Iox, [CacheLine], WireEnvelope>;

fn take(
    channel: &Channel,
    subscriber: &subscriber::Subscriber<Iox, [CacheLine], WireEnvelope>,
) -> Result<Option<MessageSample>, IpcError> {
    subscriber.receive().map_err(|cause| IpcError::transport(format!("observing {}", channel.name), cause))
}

/// A message as bytes, in shared memory.
pub struct Observed {
    sample: MessageSample,
    header_bytes: usize,
    row_bytes: usize,
}

impl Observed {
    /// The envelope.
    pub fn envelope(&self) -> &Envelope {
        &self.sample.user_header().0
    }
    fn rows_at(&self) -> usize {
        self.header_bytes.next_multiple_of(LINE)
    }
    /// Bytes of the fixed part.
    pub fn header(&self) -> &[u8] {
        &bytes_of_lines(self.sample.payload())[..self.header_bytes]
    }
    /// Bytes of the rows.
    pub fn rows(&self) -> &[u8] {
        let rows_at = self.rows_at();
        &bytes_of_lines(self.sample.payload())[rows_at..rows_at + self.envelope().len as usize * self.row_bytes]
    }
}
