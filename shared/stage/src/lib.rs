//! Everything that a stage needs to be a process of REPLICA.
//!
//! A stage implements [`Stage`] and ends its `main.rs` with `stage::run::<MyStage>()`. The runner does the rest: settings
//! with every problem reported at once, `--describe` and `--check`, topics, ticks, barriers, heartbeat, back-pressure,
//! signals, drain and exit code. See `docs/stage.md` for a stage from first line to last.

mod access;
mod alone;
pub mod assignment;
mod command;
mod contract;
pub mod control;
pub mod health;
mod histogram;
pub mod launch_file;
mod ports;
pub mod process;
mod runner;
mod settings;
mod state;
pub mod summary;
pub mod testing;
pub mod wiring;

pub use access::{Inputs, Loan, Outputs, Received};
pub use command::{CheckRequest, DescribeRequest, LOG_FORMAT, SUPERVISOR_KEYS, exit, run};
pub use contract::{Context, Flow, Mode, Port, Stage, StepError};
pub use messages;
pub use settings::{
    Field, Problem, Rule, Settings, any, at_least, each_one_of, nearest_key, one_of, parse_table, within,
};
pub use state::{
    Bytes, StateBytes, StateError, decode_head, decode_state, encode_state, next_message, saved_bytes, verify_state,
};

#[doc(hidden)]
pub use settings::{default_text, read_value};
#[doc(hidden)]
pub use {serde, toml};

extern crate self as stage;
