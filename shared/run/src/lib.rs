//! Interfaces between the supervisor, the tools and the runner of a stage: files of a run, queries to programs, exit
//! codes.
//!
//! A run has one supervisor (`replica-launch`), one process for each stage, and tools that observe it. They are
//! separate programs, may be built on different days, and communicate through files, pipes and shared memory. This
//! crate defines every format that two of them share, with its version ([`assignment::CONTRACT_VERSION`] for stages).
//!
//! | module | content |
//! |---|---|
//! | [`launch_file`], [`Change`] | launch.toml and its tables; `--set` and `--unset` |
//! | [`program`] | command line and exit codes of every program |
//! | [`assignment`] | the assignment of a stage, and the supervisor's commands |
//! | [`remote`] | the host of a stage that runs on another host |
//! | [`health`] | the heartbeat of a stage |
//! | [`state_file`] | the saved state of a stage at a barrier; `packed`: its rows |
//! | [`checksum`] | checksum of saved states and of the files that results depend on |
//! | [`wiring`] | `run/wiring.json`: description of a run for observers |
//! | `file_identity` | files on which results depend, and their digests |
//! | [`control`] | requests to a running supervisor |
//! | [`summary`], [`Outcome`] | `summary.json`; how a run ended, and the exit code for it |
//! | [`space`] | free space of file systems |
//! | [`terminal`] | size and colors of a terminal; printable text |
//! | [`threads`] | bound of the number of threads |
//! | [`process`], [`histogram`] | statistics of a process from the operating system; durations |
//!
//! The crate must never start a stage, decide about one, or touch a point: `launch` does the first two, the stages the
//! third. It refers to no stage by its name and to no key of a stage's table. A format that only one program uses
//! belongs to that program.
//!
//! Start with [`assignment`] (the input of a stage) and [`launch_file`] (its origin), then [`health`] (the reports of a
//! stage). Authors of stages use the crate `stage`, which re-exports the parts they need.

pub mod assignment;
mod change;
pub mod checksum;
pub mod context;
pub mod control;
mod file_identity;
pub mod health;
pub mod histogram;
pub mod launch_file;
pub mod observed_run;
mod outcome;
mod packed;
pub mod process;
pub mod program;
pub mod remote;
pub mod space;
pub mod state_file;
pub mod summary;
pub mod terminal;
pub mod threads;
pub mod wiring;

pub use change::{Change, ChangeError};
pub use context::{Context, DRIVE_MANIFEST, Mode, find_file};
pub use file_identity::{FileIdentity, files_of_settings};
pub use outcome::Outcome;
pub use packed::Piece;
pub use program::{
    CheckRequest, DescribeDriveRequest, DescribeRequest, DriveDescription, LOG_FORMAT, SUPERVISOR_KEYS, exit,
};
pub use remote::Remote;
pub use state_file::{StateError, saved_bytes, verify_state};
