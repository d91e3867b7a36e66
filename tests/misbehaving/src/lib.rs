//! A pipeline of three small stages: [`Source`] publishes sweeps, [`Relay`] turns each into a column and fails as set,
//! [`Sink`] writes a line per message. Whatever the relay does, the sink's file must be the same.

mod fault;
mod liar;
mod mapping;
mod relay;
mod sink;
mod source;

pub use liar::Liar;
pub use relay::{Relay, Settings as RelaySettings};
pub use sink::{Settings as SinkSettings, Sink};
pub use source::Source;
