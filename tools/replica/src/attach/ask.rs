//! Asking the supervisor of a run.

use super::Run;
use anyhow::anyhow;
use stage::control::{Answer, Request, ask};

impl Run {
    /// Asks, says on stderr what the supervisor is doing meanwhile, and waits for its last word.
    pub fn ask(&self, request: &Request) -> anyhow::Result<Answer> {
        let mut said = String::new();
        let working = |text: &str| {
            if said != text {
                eprintln!("{text}");
                text.clone_into(&mut said);
            }
        };
        ask(&self.output, request, working).map_err(|error| anyhow!(error))
    }
}
