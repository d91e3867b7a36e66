//! The answer of a command on stdout: text, or with `--json` the same facts for programs.

use crate::terminal::ignore_broken_pipe;
use anyhow::Context;
use run::terminal::printable;
use serde::Serialize;
use std::io::Write;

/// The option of every command that prints facts.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Answer {
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

impl Answer {
    /// The answer as JSON also if another option requests it.
    #[must_use]
    pub fn or(self, json: bool) -> Self {
        Self { json: self.json || json }
    }

    /// Prints the facts as a JSON object, or their text. A reader may close the pipe early.
    pub fn print(self, facts: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
        let text =
            if self.json { serde_json::to_string_pretty(facts)? + "\n" } else { printable(&text()).into_owned() };
        let written = std::io::stdout().write_all(text.as_bytes()).context("stdout");
        ignore_broken_pipe(written).map(drop)
    }

    /// Prints a line of a continuing answer: a JSON object on one line, or its text.
    pub fn print_line(self, facts: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
        let mut line = if self.json { serde_json::to_string(facts)? } else { printable(&text()).into_owned() };
        line.push('\n');
        let mut stdout = std::io::stdout().lock();
        stdout.write_all(line.as_bytes())?;
        Ok(stdout.flush()?)
    }
}
