//! Events as lines for people. On a terminal the progress of the stages is a table below them, drawn over and over.

use super::fields::Fields;
use super::write_stderr;
use crate::stage_figures::StageFigures;
use serde_json::Value;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Writes to stderr.
pub struct TerminalLayer {
    has_table: bool,
    /// Lines of the table that stands at the end of the screen.
    table_lines: Mutex<usize>,
}

impl TerminalLayer {
    /// With or without a table.
    pub fn new(has_table: bool) -> Self {
        Self { has_table, table_lines: Mutex::new(0) }
    }

    /// Replaces the table, if there is one, by `text`, of which the last `table_lines` lines are the next table.
    fn write(&self, text: &str, table_lines: usize) {
        let mut lines = self.table_lines.lock().unwrap_or_else(PoisonError::into_inner);
        // Up by the height of the table, then clear to the end of the screen.
        let erase = if *lines > 0 { format!("\x1b[{}A\x1b[J", *lines) } else { String::new() };
        write_stderr(&(erase + text));
        *lines = table_lines;
    }
}

impl<S: Subscriber> Layer<S> for TerminalLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if *event.metadata().level() > Level::INFO {
            return;
        }
        let mut fields = Fields::default();
        event.record(&mut fields);
        let message = fields.take_text("message").unwrap_or_default();
        let kind = fields.take_text("kind").unwrap_or_default();
        if kind == "progress" && self.has_table {
            let stages = fields.0.remove("stages").unwrap_or_default();
            let text = table(&serde_json::from_value::<Vec<StageFigures>>(stages).unwrap_or_default());
            let text = format!("{text}{message}\n");
            self.write(&text, text.lines().count());
            return;
        }
        let mut text = format!("{message}\n");
        if kind == "fault" {
            text += &last_log_lines(&mut fields);
        }
        self.write(&text, 0);
    }
}

/// The end of the log of a faulty stage.
fn last_log_lines(fields: &mut Fields) -> String {
    let stage = fields.take_text("stage").unwrap_or_default();
    let lines = fields.0.remove("last_log_lines");
    let lines = lines.as_ref().and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    if lines.is_empty() {
        let log = fields.take_text("log").unwrap_or_default();
        return format!("[{stage}] | ({log} is empty)\n");
    }
    // Writing to a string cannot fail.
    lines.iter().fold(String::new(), |mut text, line| {
        let _ = match line {
            Value::String(line) => writeln!(text, "[{stage}] | {line}"),
            other => writeln!(text, "[{stage}] | {other}"),
        };
        text
    })
}

fn table(stages: &[StageFigures]) -> String {
    let mut text = format!(
        "{:<16} {:<28} {:>7} {:>9} {:>17} {:>8} {:>8}\n",
        "STAGE", "STATE", "TICKS", "POINTS", "STEP p50/p99 ms", "CPU s", "RSS"
    );
    for stage in stages {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16} {:<28} {:>7} {:>8.1}M {:>8.1}/{:>8.1} {:>8.1} {:>6.2}G",
            stage.name,
            stage.activity.to_string(),
            stage.ticks,
            stage.points as f64 * 1e-6,
            stage.step.p50_ms,
            stage.step.p99_ms,
            stage.cpu_s,
            stage.rss_bytes as f64 / (1_u64 << 30) as f64
        );
    }
    text
}
