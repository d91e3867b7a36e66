//! Attaching to a running pipeline: find the run, ask its supervisor, observe its topics across restarts.

mod ask;
mod run_argument;
mod run_handle;
mod topic_reader;

pub use run::observed_run::channels;
pub use run_argument::RunArgument;
pub use run_handle::Run;
pub use topic_reader::{TopicEvent, TopicReader};
