//! A stage on another host: the connection between its run and an agent there.
//!
//! | module | idea |
//! |---|---|
//! | [`key`] | the key file that both hosts have |
//! | [`channel`] | an authenticated and encrypted stream of bytes over TCP: [`connect`], [`accept`] |
//! | [`start()`] | the first request: which program the agent starts |
//! | [`agent`] | starts the program and passes bytes between it and the connection |
//!
//! The bytes themselves are a matter of the program and of its run: `stage::remote`.

pub mod agent;
pub mod channel;
mod error;
pub mod key;
pub mod start;

pub use channel::{Receiver, Sender, accept, connect};
pub use error::LinkError;
pub use key::Key;
pub use start::{StageProgram, start};
