//! Events as lines for people. On a terminal the progress of the stages is a table below them, redrawn in place; it
//! remains after the end of the run.

use super::fields::Fields;
use super::write_stderr;
use crate::stage_figures::StageFigures;
use run::terminal::{Screen, Style, clip, printable};
use serde_json::Value;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Writes to stderr.
pub struct TerminalLayer {
    has_table: bool,
    table: Mutex<Table>,
}

/// The table at the end of the screen.
#[derive(Default)]
struct Table {
    text: String,
    /// Number of its lines on the screen.
    n_shown: usize,
}

impl TerminalLayer {
    /// A layer with or without a table.
    pub fn new(has_table: bool) -> Self {
        Self { has_table, table: Mutex::default() }
    }

    /// Writes `text` above the table, which `change` may replace or leave.
    fn write(&self, text: &str, change: impl FnOnce(&mut Table)) {
        let mut table = self.table.lock().unwrap_or_else(PoisonError::into_inner);
        // Move up by the height of the table, then clear to the end of the screen.
        let erase = if table.n_shown > 0 { format!("\x1b[{}A\x1b[J", table.n_shown) } else { String::new() };
        change(&mut table);
        table.n_shown = table.text.lines().count();
        write_stderr(&(erase + text + &table.text));
    }

    /// Writes `text` below the table, which is not drawn again: the run has ended.
    fn write_below(&self, text: &str) {
        *self.table.lock().unwrap_or_else(PoisonError::into_inner) = Table::default();
        write_stderr(text);
    }
}

impl<S: Subscriber> Layer<S> for TerminalLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let level = *event.metadata().level();
        if level > Level::INFO {
            return;
        }
        let mut fields = Fields::default();
        event.record(&mut fields);
        let message = fields.take_text("message").unwrap_or_default();
        let kind = fields.take_text("kind").unwrap_or_default();
        let screen = Screen::from_output(&std::io::stderr());
        if let Some(screen) = screen.filter(|_| kind == "progress" && self.has_table) {
            let slowest = fields.take_text("slowest").unwrap_or_default();
            let stages = fields.by_name.remove("stages").unwrap_or_default();
            let stages = serde_json::from_value::<Vec<StageFigures>>(stages).unwrap_or_default();
            let text = table(&stages, &slowest, &message, screen);
            self.write("", |table| table.text = text);
            return;
        }
        let style = match level {
            Level::ERROR => Some(Style::Red),
            Level::WARN => Some(Style::Yellow),
            _ => None,
        };
        // Messages may be longer than a line.
        let unlimited = |screen: Screen| Screen { columns: usize::MAX, ..screen };
        let line = |screen| unlimited(screen).line(&message, style);
        let mut text = screen.map_or_else(|| printable(&message).into_owned(), line) + "\n";
        if kind == "fault" {
            text += &printable(&last_log_lines(&mut fields));
        }
        if kind == "done" { self.write_below(&text) } else { self.write(&text, |_| ()) }
    }
}

/// The end of the log of a faulty stage.
fn last_log_lines(fields: &mut Fields) -> String {
    let stage = fields.take_text("stage").unwrap_or_default();
    let lines = fields.by_name.remove("last_log_lines");
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

/// Lines that fit the screen: without the stages if there is no room for them.
fn table(stages: &[StageFigures], slowest: &str, progress: &str, screen: Screen) -> String {
    let progress = screen.line(progress, None) + "\n";
    // A heading, the progress, and the line of the cursor.
    if stages.len() + 3 > screen.rows {
        return progress;
    }
    let heading = format!(
        "{:<14} {:<26} {:>6} {:>7} {:>10} {:>5} {:>5}",
        "STAGE", "STATE", "TICKS", "POINTS", "p50/p99 ms", "CPU s", "RSS"
    );
    let mut text = screen.line(&heading, Some(Style::Bold)) + "\n";
    for stage in stages {
        let is_slowest = stage.name == slowest;
        text += &screen.line(&row(stage), is_slowest.then_some(Style::Yellow));
        text.push('\n');
    }
    text + &progress
}

/// 79 characters, so that a terminal of 80 does not wrap.
fn row(stage: &StageFigures) -> String {
    let millions = stage.points as f64 * 1e-6;
    let points = if millions < 1e4 { format!("{millions:.1}M") } else { format!("{:.1}G", millions * 1e-3) };
    let ms = |ms: f64| if ms < 10.0 { format!("{ms:.1}") } else { format!("{ms:.0}") };
    format!(
        "{:<14} {:<26} {:>6} {points:>7} {:>10} {:>5.0} {:>4.1}G",
        clip(&stage.name, 14),
        clip(&stage.activity.to_string(), 26),
        stage.ticks,
        format!("{}/{}", ms(stage.step.p50_ms), ms(stage.step.p99_ms)),
        stage.cpu_s,
        stage.rss_bytes as f64 / (1_u64 << 30) as f64
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::health::{Activity, Latency};
    use std::collections::BTreeMap;

    const SCREEN: Screen = Screen { columns: 80, rows: 24, has_colors: false };

    fn stages() -> Vec<StageFigures> {
        let figures = |name: &str| StageFigures {
            name: name.to_owned(),
            activity: Activity::Blocked("trajectory".to_owned()),
            ticks: 86_400,
            points: 12_345_600_000,
            lag_s: None,
            barrier: 0,
            step: Latency { p50_ms: 1073.7, p99_ms: 2741.1, ..Latency::default() },
            age: Latency::default(),
            inputs: BTreeMap::new(),
            outputs: BTreeMap::new(),
            arrivals: BTreeMap::new(),
            waiting: BTreeMap::new(),
            cpu_s: 43_210.0,
            rss_bytes: 12 << 30,
        };
        ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"].map(figures).into()
    }

    #[test]
    fn table_of_the_sample_fits_80_by_24() {
        let progress = "[####################] 100 %  123456 s  1234 s left  slowest: slam_aggregate";
        let text = table(&stages(), "infer", progress, SCREEN);
        assert_eq!(text.lines().count(), 9);
        assert!(text.lines().all(|line| line.chars().count() < 80), "{text}");
        assert!(text.contains("waiting for output trajec…"), "{text}");
    }

    #[test]
    fn narrow_or_low_terminal_gets_what_fits() {
        let narrow = Screen { columns: 40, ..SCREEN };
        let text = table(&stages(), "", "100 %", narrow);
        assert_eq!(text.lines().count(), 9, "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 40), "{text}");
        assert_eq!(table(&stages(), "", "100 %", Screen { rows: 9, ..SCREEN }), "100 %\n");
    }

    #[test]
    fn only_the_slowest_stage_is_colored() {
        let colored = table(&stages(), "infer", "", Screen { has_colors: true, ..SCREEN });
        let yellow: Vec<&str> = colored.lines().filter(|line| line.contains("\x1b[33m")).collect();
        assert_eq!(yellow.len(), 1);
        assert!(yellow[0].contains("infer"), "{yellow:?}");
    }
}
