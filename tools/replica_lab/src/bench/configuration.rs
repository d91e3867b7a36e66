//! Configurations that are measured.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A configuration of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Configuration {
    /// Number of cores for all processes of the run.
    pub cores: usize,
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} core{}", self.cores, if self.cores == 1 { "" } else { "s" })
    }
}
