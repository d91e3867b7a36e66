//! A stage on another host: the connection between its run and an agent there.
//!
//! | module | content |
//! |---|---|
//! | [`key`] | the key file of both hosts |
//! | [`channel`] | an authenticated and encrypted stream of bytes over TCP: [`connect`], [`accept`] |
//! | [`start()`] | the first request: the program that the agent starts |
//! | [`agent`] | starts the program and passes bytes between it and the connection |
//!
//! The meaning of the bytes is defined by the program and its run: `stage::remote`.
//!
//! This crate must never send a byte of a run without encryption, or start anything before both ends have proved that
//! they have the key. It does not interpret, buffer or repeat the data of a run: a cut connection is an error for the
//! caller, which restarts the stage as after any other fault. It depends on no topic and no settings.
//!
//! Start with [`connect`] and [`accept`], the two ends of the handshake in `channel.rs`; then [`start()`] on the side
//! of the run and [`agent`] on the other host. The reasons are in `docs/explanation/two_machines.md`.

pub mod agent;
pub mod channel;
mod error;
pub mod key;
pub mod start;

pub use channel::{Receiver, Sender, accept, connect};
pub use error::LinkError;
pub use key::Key;
pub use start::{StageProgram, start};
