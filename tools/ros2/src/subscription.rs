//! Serialized messages of a topic.

use anyhow::anyhow;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SimpleDataReader};
use rustdds::policy::{History, Reliability, ResourceLimits};
use rustdds::{
    DomainParticipant, Duration, GUID, QosPolicies, QosPolicyBuilder, RepresentationIdentifier, Subscriber, Topic,
    TopicKind,
};
use std::convert::Infallible;
use std::task::Waker;

/// Largest number of messages that wait to be taken: many small messages, or few images.
const DEPTH: i32 = 1024;
const IMAGE_DEPTH: i32 = 32;
/// Not used by a reader; a publisher waits this long for readers.
const MAX_BLOCKING: Duration = Duration::from_millis(100);

/// Takes messages as bytes, with their encapsulation.
#[derive(Clone, Copy)]
pub struct Bytes;

impl DeserializerAdapter<Vec<u8>> for Bytes {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[
            RepresentationIdentifier::CDR_LE,
            RepresentationIdentifier::CDR_BE,
            RepresentationIdentifier::XCDR2_LE,
            RepresentationIdentifier::XCDR2_BE,
        ]
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for Bytes {
    type Decoder = Self;
    const DECODER: Self = Self;
}

impl Decode<'_, Vec<u8>> for Bytes {
    type Error = Infallible;

    fn decode_bytes(self, bytes: &[u8], encoding: RepresentationIdentifier) -> Result<Vec<u8>, Infallible> {
        let [high, low] = encoding.to_bytes();
        let mut message = Vec::with_capacity(4 + bytes.len());
        message.extend([high, low, 0, 0]);
        message.extend(bytes);
        Ok(message)
    }
}

/// A message that was taken.
pub struct Taken {
    pub publisher: GUID,
    /// Number of the message, from its publisher.
    pub number: i64,
    pub bytes: Vec<u8>,
}

/// A subscription of a topic.
pub struct Subscription {
    subscriber: Subscriber,
    topic: Topic,
    depth: i32,
    is_reliable: bool,
    reader: SimpleDataReader<Vec<u8>, Bytes>,
}

impl Subscription {
    /// Subscribes to a topic. `dds_name` and `dds_type` are the names in DDS.
    pub fn new(
        participant: &DomainParticipant,
        [dds_name, dds_type]: [&str; 2],
        is_image: bool,
        is_reliable: bool,
    ) -> anyhow::Result<Self> {
        let depth = if is_image { IMAGE_DEPTH } else { DEPTH };
        let qos = qos(depth, is_reliable);
        let fault = |error| anyhow!("{dds_name}: {error}");
        let subscriber = participant.create_subscriber(&qos).map_err(fault)?;
        let topic =
            participant.create_topic(dds_name.into(), dds_type.into(), &qos, TopicKind::NoKey).map_err(fault)?;
        let reader = subscriber.create_simple_datareader_no_key(&topic, Some(qos)).map_err(fault)?;
        Ok(Self { subscriber, topic, depth, is_reliable, reader })
    }

    pub fn is_reliable(&self) -> bool {
        self.is_reliable
    }

    /// Subscribes again with best effort, which fits every publisher.
    pub fn relax(&mut self) -> anyhow::Result<()> {
        let qos = qos(self.depth, false);
        let reader = self.subscriber.create_simple_datareader_no_key(&self.topic, Some(qos));
        self.reader = reader.map_err(|error| anyhow!("{error}"))?;
        self.is_reliable = false;
        Ok(())
    }

    /// Sets the waker for new messages. Call it before messages are taken.
    pub fn wake(&self, waker: &Waker) {
        self.reader.set_waker(Some(waker.clone()));
        self.reader.drain_read_notifications();
    }

    /// The next message, `None` before it arrives. An error concerns one message.
    pub fn take(&self) -> Result<Option<Taken>, String> {
        let taken = self.reader.try_take_one().map_err(|error| error.to_string())?;
        Ok(taken.map(|taken| Taken {
            publisher: taken.writer_guid,
            number: i64::from(taken.sequence_number),
            bytes: taken.into_value(),
        }))
    }
}

fn qos(depth: i32, is_reliable: bool) -> QosPolicies {
    let reliability =
        if is_reliable { Reliability::Reliable { max_blocking_time: MAX_BLOCKING } } else { Reliability::BestEffort };
    let limits = ResourceLimits { max_samples: depth, max_instances: 1, max_samples_per_instance: depth };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .history(History::KeepLast { depth })
        .resource_limits(limits)
        .build()
}
