//! Everything that a stage needs to be a process of REPLICA.
//!
//! A stage implements [`Stage`] and ends its `main.rs` with `stage::run::<MyStage>()`. The runner does the rest: settings
//! with every problem reported at once, `--describe` and `--check`, topics, ticks, barriers, heartbeat, back-pressure,
//! signals, drain and exit code. See `docs/guide/own_stage.md` for a stage from first line to last.

mod alone;
mod command;
mod command_line;
mod contract;
mod diagnostics;
mod error;
mod inputs;
mod log;
mod memory_output;
mod outputs;
mod own_table;
mod port;
mod ports;
mod program;
pub mod remote;
mod runner;
mod state;
mod state_bytes;
mod submap_join;
mod table;
pub mod testing;
pub mod untyped;

pub use command::{run, run_program};
pub use contract::{Flow, Stage};
pub use error::StepError;
pub use inputs::Inputs;
pub use ipc::{Loan, LoanFull, Received};
pub use log::catch_panic;
pub use messages;
pub use outputs::Outputs;
pub use port::Port;
pub use program::{ConfiguredStage, Program, RunningStage};
pub use run::space;
pub use run::{
    Context, Field, Mode, Problem, Rule, Settings, StateError, any, at_least, each_one_of, exit, find_file, one_of,
    parse_table, settings, toml, within,
};
pub use state::{Bytes, decode_state, encode_state};
pub use state_bytes::{StateBytes, decode_head, next_message};
pub use submap_join::{JoinedSubmap, SavedColumn, SubmapJoin};
