//! What the operator sees: one live table on a terminal, plain lines elsewhere.

use crate::child::StageProcess;
use crate::events::{Log, json_line, log_line};
use crate::watch::Fault;
use serde_json::{Value, json};
use stage::health::Activity;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

/// A table that changes more often cannot be read.
const TABLE_EVERY: Duration = Duration::from_millis(500);
/// A log with more lines than this says no more.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Programs read faster.
const JSON_EVERY: Duration = Duration::from_secs(1);

/// Writes to stderr.
pub struct Screen {
    log: Log,
    terminal: bool,
    begun: Instant,
    last: Option<Instant>,
    table_lines: usize,
    said: BTreeSet<String>,
}

impl Screen {
    /// Looks whether stderr is a terminal.
    pub fn new(log: Log) -> Self {
        let terminal = std::io::stderr().is_terminal() && log == Log::Text;
        Self { log, terminal, begun: Instant::now(), last: None, table_lines: 0, said: BTreeSet::new() }
    }

    /// The run begins now.
    pub fn begin(&mut self) {
        self.begun = Instant::now();
    }

    /// A line of its own, above the table.
    pub fn say(&mut self, text: &str) {
        self.tell("said", text, Value::Null);
    }

    /// As [`Screen::say`]; `kind` and `fields` are for programs.
    pub fn tell(&mut self, kind: &str, text: &str, fields: Value) {
        self.erase_table();
        match self.log {
            Log::Text => write_stderr(&format!("{text}\n")),
            Log::Json => write_stderr(&json_line(kind, text, fields)),
        }
    }

    /// What went wrong, with the stage's last words out of its log.
    pub fn fault(&mut self, fault: &Fault, last_words: &[String], log: &Path) {
        let stage = &fault.stage;
        let words: Vec<Value> = last_words.iter().map(|line| log_line(line)).collect();
        let fields = json!({"stage": stage, "fault": fault.text, "last_words": words, "log": log});
        self.tell("fault", &format!("[{stage}] {}", fault.text), fields);
        if self.log == Log::Json {
            return;
        }
        for line in last_words {
            self.say(&format!("[{stage}] | {line}"));
        }
        if last_words.is_empty() {
            self.say(&format!("[{stage}] | (nothing in {})", log.display()));
        }
    }

    /// How a stage's process speaks.
    pub fn log(&self) -> Log {
        self.log
    }

    /// Shows where the run is, if it is time to.
    pub fn show(&mut self, processes: &[StageProcess]) {
        for process in processes {
            for note in &process.health.notes {
                let text = format!("[{}] {note}", process.name);
                if self.said.insert(text.clone()) {
                    self.tell("note", &text, json!({"stage": process.name, "note": note}));
                }
            }
        }
        let every = match self.log {
            Log::Json => JSON_EVERY,
            Log::Text if self.terminal => TABLE_EVERY,
            Log::Text => LINE_EVERY,
        };
        let last = *self.last.get_or_insert(self.begun);
        if last.elapsed() < every {
            return;
        }
        self.last = Some(Instant::now());
        let progress = self.progress(processes);
        if self.terminal {
            let table = table(processes) + &progress;
            self.erase_table();
            self.table_lines = table.lines().count();
            write_stderr(&table);
        } else {
            self.tell("progress", progress.trim_end(), figures(processes));
        }
    }

    fn erase_table(&mut self) {
        if self.table_lines > 0 {
            // Up by the table's height, then clear to the end of the screen.
            write_stderr(&format!("\x1b[{}A\x1b[J", self.table_lines));
            self.table_lines = 0;
        }
    }

    /// Progress is that of the slowest stage, in drive time.
    fn progress(&self, processes: &[StageProcess]) -> String {
        let slowest = processes.iter().min_by(|a, b| a.health.progress.total_cmp(&b.health.progress));
        let Some(slowest) = slowest else { return String::new() };
        let share = slowest.health.progress.clamp(0.0, 1.0);
        let elapsed = self.begun.elapsed().as_secs_f64();
        let left =
            if share > 0.0 { format!("{:.0} s left", elapsed * (1.0 - share) / share) } else { "starting".to_owned() };
        let filled = (share * 20.0) as usize;
        let waits: Vec<String> = processes.iter().filter_map(wait).collect();
        let waits = if share > 0.0 || waits.is_empty() { String::new() } else { format!("  {}", waits.join(", ")) };
        format!(
            "[{}{}] {:3.0} %  {elapsed:.0} s  {left}  slowest: {}{waits}\n",
            "#".repeat(filled),
            "-".repeat(20 - filled),
            share * 100.0,
            slowest.name
        )
    }
}

/// The live figures of the stages.
fn figures(processes: &[StageProcess]) -> Value {
    let share = processes.iter().map(|process| process.health.progress).fold(1.0, f64::min);
    let newest = processes.iter().filter_map(|process| process.health.drive_time).max();
    let stages: Vec<Value> = processes
        .iter()
        .map(|process| {
            let health = &process.health;
            let lag = newest.zip(health.drive_time).map(|(newest, own)| newest.saturating_sub(own) as f64 * 1e-9);
            json!({
                "name": process.name, "activity": health.activity, "ticks": health.ticks, "points": health.points,
                "lag_s": lag, "barrier": health.barrier, "step": health.step, "age": health.age,
                "inputs": health.inputs, "outputs": health.outputs, "arrivals": health.arrivals,
                "waiting": health.waiting, "cpu_s": health.cpu_s, "rss_bytes": health.rss_bytes,
            })
        })
        .collect();
    json!({"share": share, "stages": stages})
}

/// A terminal that is gone shows nothing; the run goes on.
fn write_stderr(text: &str) {
    let mut stderr = std::io::stderr().lock();
    let _ = stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush());
}

fn wait(process: &StageProcess) -> Option<String> {
    match &process.health.activity {
        Activity::Connecting(topic) => Some(format!("{}: waiting for {topic}", process.name)),
        Activity::Starting => Some(format!("{}: starting", process.name)),
        _ => None,
    }
}

fn table(processes: &[StageProcess]) -> String {
    let mut text = format!(
        "{:<16} {:<22} {:>7} {:>9} {:>17} {:>8} {:>8}\n",
        "STAGE", "STATE", "TICKS", "POINTS", "STEP p50/p99 ms", "CPU s", "RSS"
    );
    for process in processes {
        let health = &process.health;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16} {:<22} {:>7} {:>8.1}M {:>8.1}/{:>8.1} {:>8.1} {:>6.2}G",
            process.name,
            state(&health.activity),
            health.ticks,
            health.points as f64 * 1e-6,
            health.step.p50_ms,
            health.step.p99_ms,
            health.cpu_s,
            health.rss_bytes as f64 / (1_u64 << 30) as f64
        );
    }
    text
}

fn state(activity: &Activity) -> String {
    match activity {
        Activity::Starting => "starting".to_owned(),
        Activity::Connecting(topic) => format!("waiting for {topic}"),
        Activity::Ready => "ready".to_owned(),
        Activity::Waiting(topic) => format!("idle ({topic})"),
        Activity::Working => "working".to_owned(),
        Activity::Blocked(topic) => format!("held up ({topic})"),
        Activity::Paused => "paused".to_owned(),
        Activity::Saving => "saving".to_owned(),
        Activity::Draining => "draining".to_owned(),
        Activity::Done => "done".to_owned(),
    }
}
