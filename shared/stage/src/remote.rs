//! A stage on another host: its run and its program there exchange requests and answers over a stream of bytes.
//!
//! | module | idea |
//! |---|---|
//! | `wire` | the requests and answers as bytes |
//! | `far` | the program of the stage, on the other host: answers requests on its standard input |
//! | `near` | the program that stands for it in the run, and its answers to the supervisor |
//! | `stand_in` | the stage of this program: forwards each step, each state |
//! | `connection` | its requests and their answers |
//!
//! The run knows nothing of the other host. To it, `stand_in` is a stage like any other: ticks, barriers, credits, heartbeat, swaps and
//! the states on the disk are its own. The other host keeps nothing: a lost connection is a fault of `stand_in`, and the next process
//! loads the state of the last barrier into a new program there.

mod connection;
mod far;
mod near;
mod stand_in;
mod wire;

pub use connection::{Connect, Connection};
pub(crate) use far::serve;
pub use near::run;
