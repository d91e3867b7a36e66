//! Requests to the supervisor of a run.

use super::run_handle::Run;
use anyhow::anyhow;
use command_line::say_error;
use run::control::{Answer, Request, ask};

impl Run {
    /// Sends a request and waits for the final answer. The progress that the supervisor reports goes to stderr.
    pub fn ask(&self, request: &Request) -> anyhow::Result<Answer> {
        let mut reported = String::new();
        let report = |text: &str| {
            if reported != text {
                say_error!("{text}");
                text.clone_into(&mut reported);
            }
        };
        ask(&self.output, request, report).map_err(|error| anyhow!(error))
    }
}
