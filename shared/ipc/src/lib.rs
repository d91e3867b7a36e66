//! Topics over iceoryx2: loan, publish, receive. The only crate that uses iceoryx2.
//!
//! A [`Domain`] holds the services and the shared memory of one run. The supervisor creates every service and holds it
//! open ([`ServiceHandles`]); stages open them. Credits prevent the loss of messages: a consumer acknowledges the
//! messages it has taken, a producer sends only messages that fit the slowest consumer's queue, and both sleep on a
//! [`Wake`] in between.
//!
//! This crate depends on no stage, no launch file and no content of a message: it moves bytes whose layout `messages`
//! declares, and checks only sizes and type names. It must never drop a message of an offline run, copy a row between
//! processes, or let an observer change what stages receive. Only `slot.rs` may contain unsafe code.
//!
//! Start with [`Publisher`] (a loan becomes a message) and [`Subscriber`] (a message is received and acknowledged);
//! `channel` has the queue and the credits between them, `wake` the sleep, `observer` the readers that are not stages.
//! The reasons are in `docs/explanation/transport.md`.
//!
//! The cost of copying instead: `benches/transport.rs`.

mod attached;
mod channel;
mod domain;
mod error;
mod latest;
mod message;
mod message_subscriber;
mod message_type;
mod node;
mod observer;
mod opaque;
mod own_memory;
mod ownership;
mod publisher;
mod service_handles;
mod shared_memory;
mod slot;
mod subscriber;
mod untyped_publisher;
mod untyped_subscriber;
mod wake;

pub use attached::Attached;
pub use channel::Channel;
pub use domain::Domain;
pub use error::{IpcError, LoanFull};
pub use latest::{LatestPublisher, LatestSubscriber};
pub use message::{Loan, Received, SavedMessageError};
pub use node::Node;
pub use observer::{Observed, Observer, ObserverMode};
pub use ownership::{PrivateFolderError, create_private_folder, is_foreign};
pub use publisher::Publisher;
pub use service_handles::ServiceHandles;
pub use subscriber::Subscriber;
pub use wake::{Wake, Waker};

/// The kind of service: processes on one machine, ports used by the thread that created them.
type Iox = iceoryx2::prelude::ipc::Service;

/// The acknowledgement of a lossless observer before its first message.
const NOTHING_TAKEN: u64 = u64::MAX;
