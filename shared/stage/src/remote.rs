//! A stage on another host: its run and its program there exchange requests and answers over a stream of bytes.
//!
//! | module | idea |
//! |---|---|
//! | `wire` | the requests and answers as bytes |
//! | `far` | the program of the stage, on the other host: answers requests on its standard input |
//! | `near` | its proxy program in the run, and its answers to the supervisor |
//! | `stand_in` | the stage of the proxy program: forwards each step and each state |
//! | `connection` | the requests of the proxy and their answers |
//!
//! The run does not depend on the other host. To the run, `stand_in` is a stage like any other: it owns ticks,
//! barriers, credits, heartbeat, swaps and the states on the disk. The other host keeps nothing: a lost connection is a
//! fault of `stand_in`, and the next process loads the state of the last barrier into a new program there.

mod connection;
mod far;
mod near;
mod stand_in;
mod wire;

pub use connection::{Connect, Connection};
pub(crate) use far::serve;
pub use near::run;
