//! A run that the command line names.

use command_line::usage_error::UsageError;
use run::observed_run::ObservedRun;
use run::wiring::WiredTopic;
use std::ops::{Deref, DerefMut};
use std::path::Path;

/// A run, as its supervisor describes it.
pub struct Run(ObservedRun);

impl Run {
    pub(super) fn read(output: &Path) -> anyhow::Result<Self> {
        Ok(Self(ObservedRun::read(output)?))
    }

    /// The topic called `name`. Another name is wrong usage.
    pub fn topic(&self, name: &str) -> anyhow::Result<&WiredTopic> {
        self.0.topic(name).map_err(|error| UsageError(error.to_string()).into())
    }
}

impl Deref for Run {
    type Target = ObservedRun;
    fn deref(&self) -> &ObservedRun {
        &self.0
    }
}

impl DerefMut for Run {
    fn deref_mut(&mut self) -> &mut ObservedRun {
        &mut self.0
    }
}
