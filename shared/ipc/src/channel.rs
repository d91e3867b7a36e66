//! A channel: one producer, its consumers, and the bounds between them.

use crate::domain::service_name;
use crate::message_type::MessageType;
use crate::opaque::Opaque;
use crate::slot::{CacheLine, LINE, WireEnvelope};
use crate::{Iox, IpcError, Node};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe;
use messages::Message;
use serde::{Deserialize, Serialize};

/// A port factory of messages.
pub(crate) type MessageService = publish_subscribe::PortFactory<Iox, [CacheLine], WireEnvelope>;

/// Largest number of simultaneous observers of a topic ([`crate::Observer`]): three terminals.
pub(crate) const MAX_OBSERVERS: usize = 3;

/// Largest number of simultaneous loans of a stage: one kept open over several steps, one for a message in between.
pub(crate) const MAX_LOANS: usize = 2;

/// Parameters on which producer and consumers of a topic must agree. Needs no types, so that the supervisor can create
/// the services of third-party topics.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channel {
    /// Name of the service.
    pub name: String,
    /// [`Message::VERSION`].
    pub version: u32,
    /// [`Message::LAYOUT`].
    pub layout: u64,
    /// Bytes of [`Message::Header`].
    pub header_bytes: usize,
    /// Bytes of [`Message::Row`].
    pub row_bytes: usize,
    /// [`Message::MAX_ROWS`].
    pub max_rows: usize,
    /// The producer never waits for room: in a full queue, the newest message replaces the oldest.
    pub drops_oldest: bool,
    /// [`Message::QUEUE`].
    pub queue: usize,
    /// [`Message::BORROWED`].
    pub borrowed: usize,
    /// Wake of the producer, notified when a slot is free again.
    pub producer: String,
    /// Wakes of the consumers, notified when there is a message to take.
    pub consumers: Vec<String>,
}

impl Channel {
    /// The channel of `T` under the name `name`.
    pub fn new<T: Message>(name: &str, producer: &str, consumers: &[String]) -> Self {
        Self {
            name: name.to_owned(),
            version: T::VERSION,
            layout: T::LAYOUT,
            header_bytes: size_of::<T::Header>(),
            row_bytes: size_of::<T::Row>(),
            max_rows: T::MAX_ROWS,
            drops_oldest: false,
            queue: T::QUEUE,
            borrowed: T::BORROWED,
            producer: producer.to_owned(),
            consumers: consumers.to_vec(),
        }
    }

    /// Shared memory that the producer and each consumer map, bytes: slots of the largest message for all messages that
    /// may be in flight, held and loaned at a time. Unwritten slots use address space, but no memory.
    pub fn mapped_bytes(&self) -> u64 {
        let n_readers = (self.consumers.len() + MAX_OBSERVERS) as u64;
        let n_slots = n_readers * (2 * self.queue + self.borrowed) as u64 + MAX_LOANS as u64;
        let header = self.header_bytes.next_multiple_of(LINE) as u64;
        n_slots * (header + self.row_bytes as u64 * self.max_rows as u64)
    }

    /// Services that the producer opens for it: the messages, the acknowledgements of the consumers, and the
    /// acknowledgement of an observer. The wakes of the consumers, which channels share, are not included.
    pub fn services_of_producer(&self) -> usize {
        2 + self.consumers.len()
    }

    /// Services that a consumer opens for it: the messages and its acknowledgement. The wake of the producer, which
    /// channels share, is not included.
    pub const SERVICES_OF_CONSUMER: usize = 2;

    /// Services that the supervisor creates for it.
    pub fn n_services(&self) -> usize {
        2 + self.consumers.len()
    }

    pub(crate) fn attributes(&self) -> [(&'static str, String); 2] {
        [("version", self.version.to_string()), ("layout", format!("{:016x}", self.layout))]
    }

    /// Service on which consumer `index` acknowledges the messages it has taken.
    pub(crate) fn acknowledgement(&self, index: usize) -> String {
        format!("{}.taken.{index}", self.name)
    }

    /// Service on which a lossless observer acknowledges the messages it has taken.
    pub(crate) fn observer_acknowledgement(&self) -> String {
        format!("{}.taken.observer", self.name)
    }

    pub(crate) fn builder(
        &self,
        node: &Node,
    ) -> Result<iceoryx2::service::builder::publish_subscribe::Builder<[CacheLine], WireEnvelope, Iox>, IpcError> {
        Ok(node
            .inner
            .service_builder(&service_name(&self.name)?)
            .publish_subscribe::<[CacheLine]>()
            .user_header::<WireEnvelope>()
            .max_publishers(1)
            .max_subscribers(self.consumers.len() + MAX_OBSERVERS)
            // Producer, consumers, observers and the supervisor, which holds the service open.
            .max_nodes(self.consumers.len() + MAX_OBSERVERS + 2)
            .subscriber_max_buffer_size(self.queue)
            // Messages that wait for their tick to be complete count as borrowed, in addition to the messages that the
            // stage holds.
            .subscriber_max_borrowed_samples(self.queue + self.borrowed)
            .history_size(0)
            .enable_safe_overflow(self.drops_oldest))
    }

    /// Fails if the run's description of the topic differs from `message`: a program describes itself, and may be
    /// wrong.
    pub(crate) fn check_type(&self, message: &MessageType) -> Result<(), IpcError> {
        if (self.version, self.layout) == (message.version, message.layout) {
            return Ok(());
        }
        let ours = format!("this program has version {}, layout {:016x}", message.version, message.layout);
        let theirs = format!("the run has version {}, layout {:016x}", self.version, self.layout);
        Err(IpcError::transport(format!("opening topic {}", self.name), format_args!("{ours}; {theirs}")))
    }

    /// Opens the service of the messages. Needs no type.
    pub(crate) fn open(&self, node: &Node) -> Result<Opaque<MessageService>, IpcError> {
        let mut verifier = AttributeVerifier::new();
        for (key, value) in self.attributes() {
            verifier = verifier
                .require(&attribute(key)?, &attribute(&value)?)
                .map_err(|cause| IpcError::transport(format!("service attribute {key}"), cause))?;
        }
        self.builder(node)?
            .open_with_attributes(&verifier)
            .map(Opaque::new)
            .map_err(|cause| IpcError::transport(format!("opening topic {}", self.name), cause))
    }
}

pub(crate) fn attribute<T>(text: &str) -> Result<T, IpcError>
where
    T: for<'a> TryFrom<&'a str>,
    for<'a> <T as TryFrom<&'a str>>::Error: std::fmt::Debug,
{
    T::try_from(text).map_err(|cause| IpcError::transport(format!("service attribute {text:?}"), cause))
}
