//! Everything that a stage needs to be a process of REPLICA.
//!
//! A stage implements [`Stage`] and ends its `main.rs` with `stage::run::<MyStage>()`. The runner does the rest: settings
//! with every problem reported at once, `--describe` and `--check`, topics, ticks, barriers, heartbeat, back-pressure,
//! signals, drain and exit code. See `docs/guide/own_stage.md` for a stage from first line to last.
//!
//! | part | content |
//! |---|---|
//! | [`Stage`], [`Port`], [`settings!`], [`words!`] | the contract: topics, settings, one step per tick |
//! | [`Inputs`], [`Outputs`], [`SubmapJoin`] | messages of a tick; a submap with its columns |
//! | [`StateBytes`], [`decode_state`] | the state at a barrier |
//! | [`testing`] | a stage in a test, without processes |
//! | `runner` | ticks, barriers, heartbeat, back-pressure: the loop around `step` |
//! | [`untyped`], [`remote`] | stages known at run time, such as stages in Python; stages on another host |
//! | `alone` | `run --recording`, with the feature `alone` |
//!
//! The crate must never depend on a stage, a sensor or a file format of the project: a third-party stage depends on it
//! alone, and compiles its dependencies. Therefore heavy parts are features: `alone` (MCAP), and `messages/geometry`
//! (poses as transforms).
//!
//! Start with [`Stage`] in `contract.rs`, then `examples/height_segmenter`. The life of a process is in `command.rs`,
//! then `runner.rs`.

#[cfg(feature = "alone")]
mod alone;
mod columns;
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

pub use columns::{AllColumns, ColumnPort, ColumnTable};
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
pub use run::{Context, Mode, StateError, exit, find_file, space};
pub use settings::{
    Field, Problem, Rule, Settings, Word, any, at_least, list_of_words, one_word, parse_table, settings, toml, within,
    words,
};
pub use state::{Bytes, decode_state, encode_state};
pub use state_bytes::{StateBytes, decode_head, next_message};
pub use submap_join::{JoinedSubmap, SavedColumn, SubmapJoin};
