//! A stage on another host: its run and its program there exchange requests and answers over a stream of bytes.
//!
//! | module | idea |
//! |---|---|
//! | `wire` | the requests and answers as bytes |
//! | `far` | the program of the stage, on the other host: answers requests on its standard input |
//! | `near` | in the run, a process that is the stage to all others: forwards each step, each state |
//!
//! The run knows nothing of the other host. To it, `near` is a stage like any other: ticks, barriers, credits, heartbeat, swaps and
//! the states on the disk are its own. The other host keeps nothing: a lost connection is a fault of `near`, and the next process
//! loads the state of the last barrier into a new program there.

mod far;
mod near;
mod wire;

pub(crate) use far::serve;
pub use near::{Connect, Connection, run};
