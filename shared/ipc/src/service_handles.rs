//! The services of a run, held open by its supervisor.

use crate::channel::{MAX_OBSERVERS, MessageService, attribute};
use crate::domain::service_name;
use crate::latest::{LatestService, builder};
use crate::opaque::Opaque;
use crate::{Channel, Iox, IpcError, Node};
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::event;

/// Handles of the services of a run. As long as the supervisor holds them, the services outlive any stage.
#[derive(Default)]
pub struct ServiceHandles {
    /// The message services, with the number of consumers.
    messages: Vec<(Opaque<MessageService>, usize)>,
    latest: Vec<Opaque<LatestService>>,
    wakes: Vec<Opaque<event::PortFactory<Iox>>>,
}

impl ServiceHandles {
    /// Whether more processes than the consumers read a channel, alive or dead.
    pub fn have_observers(&self) -> bool {
        self.messages
            .iter()
            .any(|(service, n_consumers)| service.dynamic_config().number_of_subscribers() > *n_consumers)
    }

    /// Creates a topic's service and its acknowledgements.
    pub fn create_channel(&mut self, node: &Node, channel: &Channel) -> Result<(), IpcError> {
        self.create_messages(node, channel)?;
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
        self.messages.push((Opaque::new(service), channel.consumers.len()));
        Ok(())
    }

    /// Creates the service of a latest value.
    pub fn create_latest(&mut self, node: &Node, name: &str) -> Result<(), IpcError> {
        let service =
            builder(node, name)?.create().map_err(|cause| IpcError::transport(format!("creating {name}"), cause))?;
        self.latest.push(Opaque::new(service));
        Ok(())
    }

    /// Creates the service of a wake that at most `max_wakers` other processes use.
    pub fn create_wake(&mut self, node: &Node, name: &str, max_wakers: usize) -> Result<(), IpcError> {
        let service = node
            .inner
            .service_builder(&service_name(name)?)
            .event()
            .max_listeners(1)
            .max_notifiers(max_wakers + MAX_OBSERVERS)
            // The sleeping process, its wakers, observers, and the supervisor.
            .max_nodes(max_wakers + MAX_OBSERVERS + 2)
            .create()
            .map_err(|cause| IpcError::transport(format!("creating wake {name}"), cause))?;
        self.wakes.push(Opaque::new(service));
        Ok(())
    }
}
