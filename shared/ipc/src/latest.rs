//! A value of which only the latest counts: heartbeats, commands, acknowledgements. A reader receives values that are
//! published after it has connected, so writers publish repeatedly.

use crate::domain::service_name;
use crate::opaque::Opaque;
use crate::{Iox, IpcError, Node};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{publisher, subscriber};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe;

/// A port factory of latest values.
pub(crate) type LatestService = publish_subscribe::PortFactory<Iox, [u8], ()>;

/// Largest value, bytes. A health report has about 2 KiB and at most some tens of KiB of notes.
const MAX_BYTES: usize = 64 << 10;

pub(crate) fn builder(
    node: &Node,
    name: &str,
) -> Result<iceoryx2::service::builder::publish_subscribe::Builder<[u8], (), Iox>, IpcError> {
    Ok(node
        .inner
        .service_builder(&service_name(name)?)
        .publish_subscribe::<[u8]>()
        .max_publishers(1)
        // The reader that the run depends on, and three observers.
        .max_subscribers(4)
        .max_nodes(6)
        .history_size(0)
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(1)
        .enable_safe_overflow(true))
}

fn open(node: &Node, name: &str) -> Result<Opaque<LatestService>, IpcError> {
    builder(node, name)?.open().map(Opaque::new).map_err(|cause| IpcError::transport(format!("opening {name}"), cause))
}

/// Writes a latest value.
pub struct LatestPublisher {
    name: String,
    service: Opaque<LatestService>,
    publisher: Opaque<publisher::Publisher<Iox, [u8], ()>>,
}

impl LatestPublisher {
    /// Opens the service that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let service = open(node, name)?;
        let publisher = service
            .publisher_builder()
            .max_loaned_samples(1)
            .initial_max_slice_len(MAX_BYTES)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map(Opaque::new)
            .map_err(|cause| IpcError::transport(format!("publisher of {name}"), cause))?;
        Ok(Self { name: name.to_owned(), service, publisher })
    }
    /// Replaces the value.
    pub fn publish(&self, value: &[u8]) -> Result<(), IpcError> {
        let sample = self
            .publisher
            .loan_slice_uninit(value.len())
            .map_err(|cause| IpcError::transport(format!("loan of {} bytes on {}", value.len(), self.name), cause))?;
        sample
            .write_from_slice(value)
            .send()
            .map(drop)
            .map_err(|cause| IpcError::transport(format!("publishing {}", self.name), cause))
    }
    /// Whether there is a reader.
    pub fn has_reader(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }
}

/// Reads a latest value.
pub struct LatestSubscriber {
    name: String,
    service: Opaque<LatestService>,
    subscriber: Opaque<subscriber::Subscriber<Iox, [u8], ()>>,
}

impl LatestSubscriber {
    /// Opens the service that the [`crate::ServiceHandles`] created.
    pub fn open(node: &Node, name: &str) -> Result<Self, IpcError> {
        let service = open(node, name)?;
        let subscriber = service
            .subscriber_builder()
            .create()
            .map(Opaque::new)
            .map_err(|cause| IpcError::transport(format!("subscriber of {name}"), cause))?;
        Ok(Self { name: name.to_owned(), service, subscriber })
    }
    /// The value if it is newer than the one read before.
    pub fn poll(&self) -> Result<Option<Vec<u8>>, IpcError> {
        let mut latest = None;
        while let Some(sample) =
            self.subscriber.receive().map_err(|cause| IpcError::transport(format!("reading {}", self.name), cause))?
        {
            latest = Some(sample.payload().to_vec());
        }
        Ok(latest)
    }
    /// Connects to the writer. Returns whether it is connected.
    pub fn connect(&self) -> Result<bool, IpcError> {
        self.subscriber
            .update_connections()
            .map_err(|cause| IpcError::transport(format!("connecting to {}", self.name), cause))?;
        Ok(self.service.dynamic_config().number_of_publishers() > 0)
    }
}
