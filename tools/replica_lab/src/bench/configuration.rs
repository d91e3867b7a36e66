//! Configurations that are measured.

use ipc::Transport;
use serde::Serialize;
use std::fmt;

/// A configuration of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Configuration {
    /// Number of cores for all processes of the run.
    pub cores: usize,
    /// See [`Transport`].
    pub transport: Transport,
}

impl Configuration {
    /// The value of `run.transport`.
    pub fn transport_name(&self) -> &'static str {
        match self.transport {
            Transport::Shared => "shared",
            Transport::Copying => "copying",
        }
    }
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} core{}", self.transport_name(), self.cores, if self.cores == 1 { "" } else { "s" })
    }
}
