//! A channel: one producer, its consumers, and the bounds between them.

use crate::domain::service_name;
use crate::loan::{CacheLine, WireEnvelope};
use crate::{Iox, IpcError, Node};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use messages::Message;
use serde::{Deserialize, Serialize};

/// A port factory of messages.
pub(crate) type MessageService = publish_subscribe::PortFactory<Iox, [CacheLine], WireEnvelope>;
/// A port factory of latest values.
pub(crate) type LatestService = publish_subscribe::PortFactory<Iox, [u8], ()>;

/// How the messages of a channel travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// In shared memory: written once, read in place.
    #[default]
    Shared,
    /// Through a socket to each consumer, into memory of its own. For comparison only.
    Copying,
}
/// Processes that may look on at a topic beside its consumers ([`crate::Observer`]); three terminals at a time.
pub(crate) const MAX_OBSERVERS: usize = 3;

/// What producer and consumers of a topic must agree on. Needs no types, so that the supervisor can create the services
/// of topics that only somebody else's stages know.
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
    /// Nobody waits for room: where a queue is full, its oldest message makes way for the newest.
    pub drops_oldest: bool,
    /// [`Message::QUEUE`].
    pub queue: usize,
    /// [`Message::BORROWED`].
    pub borrowed: usize,
    /// Wake of the producer, notified when a slot is free again.
    pub producer: String,
    /// Wakes of the consumers, notified when there is something to take.
    pub consumers: Vec<String>,
    /// How the messages travel.
    #[serde(default)]
    pub transport: Transport,
}

impl Channel {
    /// The channel of `T` under the name `name`.
    pub fn of<T: Message>(name: &str, producer: &str, consumers: &[String]) -> Self {
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
            transport: Transport::Shared,
        }
    }

    fn attributes(&self) -> [(&'static str, String); 2] {
        [("version", self.version.to_string()), ("layout", format!("{:016x}", self.layout))]
    }

    /// Service on which consumer `index` says how much it has taken.
    pub(crate) fn acknowledgement(&self, index: usize) -> String {
        format!("{}.taken.{index}", self.name)
    }

    /// Service on which a lossless observer says what it has taken.
    pub(crate) fn observer_acknowledgement(&self) -> String {
        format!("{}.taken.observer", self.name)
    }

    fn builder(
        &self,
        node: &Node,
    ) -> Result<iceoryx2::service::builder::publish_subscribe::Builder<[CacheLine], WireEnvelope, Iox>, IpcError> {
        Ok(node
            .0
            .service_builder(&service_name(&self.name)?)
            .publish_subscribe::<[CacheLine]>()
            .user_header::<WireEnvelope>()
            .max_publishers(1)
            .max_subscribers(self.consumers.len() + MAX_OBSERVERS)
            // Producer, consumers, observers and the supervisor that keeps the service.
            .max_nodes(self.consumers.len() + MAX_OBSERVERS + 2)
            .subscriber_max_buffer_size(self.queue)
            // What waits for its tick to be complete counts as borrowed, beside what the stage holds.
            .subscriber_max_borrowed_samples(self.queue + self.borrowed)
            .history_size(0)
            .enable_safe_overflow(self.drops_oldest))
    }

    /// Refuses if the run's idea of the topic is not that of `T`: the channel was drawn up from what a program said of
    /// itself, which need not be what it is.
    pub(crate) fn open_as<T: Message>(&self, node: &Node) -> Result<MessageService, IpcError> {
        if (self.version, self.layout) != (T::VERSION, T::LAYOUT) {
            let ours = format!("this program has version {}, layout {:016x}", T::VERSION, T::LAYOUT);
            let theirs = format!("the run version {}, layout {:016x}", self.version, self.layout);
            return Err(IpcError::transport(format!("opening topic {}", self.name), format_args!("{ours}; {theirs}")));
        }
        self.open(node)
    }

    /// For those who know the topic by its channel alone.
    pub(crate) fn open(&self, node: &Node) -> Result<MessageService, IpcError> {
        let mut verifier = AttributeVerifier::new();
        for (key, value) in self.attributes() {
            verifier = verifier
                .require(&attribute(key)?, &attribute(&value)?)
                .map_err(|cause| IpcError::transport(format!("service attribute {key}"), cause))?;
        }
        self.builder(node)?
            .open_with_attributes(&verifier)
            .map_err(|cause| IpcError::transport(format!("opening topic {}", self.name), cause))
    }
}

fn attribute<T>(text: &str) -> Result<T, IpcError>
where
    T: for<'a> TryFrom<&'a str>,
    for<'a> <T as TryFrom<&'a str>>::Error: std::fmt::Debug,
{
    T::try_from(text).map_err(|cause| IpcError::transport(format!("service attribute {text:?}"), cause))
}

/// Holds the services of a run open, so that they outlive any stage. Kept by the supervisor.
#[derive(Default)]
pub struct Keeper {
    messages: Vec<MessageService>,
    latest: Vec<LatestService>,
    wakes: Vec<event::PortFactory<Iox>>,
}

impl Keeper {
    /// Creates a topic's service and its acknowledgements.
    pub fn create_channel(&mut self, node: &Node, channel: &Channel) -> Result<(), IpcError> {
        // A socket is its producer's to make.
        if channel.transport == Transport::Shared {
            self.create_messages(node, channel)?;
        }
        for index in 0..channel.consumers.len() {
            self.create_latest(node, &channel.acknowledgement(index))?;
        }
        self.create_latest(node, &channel.observer_acknowledgement())
    }

    fn create_messages(&mut self, node: &Node, channel: &Channel) -> Result<(), IpcError> {
        let mut specifier = AttributeSpecifier::new();
        for (key, value) in channel.attributes() {
            specifier = specifier
                .define(&attribute(key)?, &attribute(&value)?)
                .map_err(|cause| IpcError::transport(format!("service attribute {key}"), cause))?;
        }
        let service = channel
            .builder(node)?
            .create_with_attributes(&specifier)
            .map_err(|cause| IpcError::transport(format!("creating topic {}", channel.name), cause))?;
        self.messages.push(service);
        Ok(())
    }

    /// Creates the service of a latest value.
    pub fn create_latest(&mut self, node: &Node, name: &str) -> Result<(), IpcError> {
        let service = crate::latest::builder(node, name)?
            .create()
            .map_err(|cause| IpcError::transport(format!("creating {name}"), cause))?;
        self.latest.push(service);
        Ok(())
    }

    /// Creates the service of a wake that at most `max_wakers` others ring.
    pub fn create_wake(&mut self, node: &Node, name: &str, max_wakers: usize) -> Result<(), IpcError> {
        let service = node
            .0
            .service_builder(&service_name(name)?)
            .event()
            .max_listeners(1)
            .max_notifiers(max_wakers + MAX_OBSERVERS)
            // The one who waits, those who ring, observers, and the supervisor.
            .max_nodes(max_wakers + MAX_OBSERVERS + 2)
            .create()
            .map_err(|cause| IpcError::transport(format!("creating wake {name}"), cause))?;
        self.wakes.push(service);
        Ok(())
    }
}
