//! Topics over iceoryx2: loan, publish, receive. The only crate that names it.
//!
//! A [`Domain`] is one run's own world in shared memory. In it the supervisor creates every service and keeps it
//! ([`Keeper`]); stages open them. Lossless by credits: a consumer acknowledges what it took, a producer sends only what
//! fits the slowest consumer's queue, and both sleep on a [`Wake`] in between.
//!
//! The same ends can send through sockets and copy instead ([`Transport::Copying`]), to see what that would cost.

mod channel;
mod copying;
mod domain;
mod error;
mod latest;
mod loan;
mod memory;
mod observer;
mod publisher;
mod subscriber;
mod visit;
mod wake;

pub use channel::{Channel, Keeper, Transport};
pub use domain::{Domain, Node};
pub use error::IpcError;
pub use latest::{LatestPublisher, LatestSubscriber};
pub use memory::{Loan, Received};
pub use observer::{Looking, Observed, Observer};
pub use publisher::Publisher;
pub use subscriber::Subscriber;
pub use visit::Visit;
pub use wake::{Wake, Waker};

/// The kind of service: processes on one machine, ports used by the thread that made them.
type Iox = iceoryx2::prelude::ipc::Service;
