//! One stage's process.

use crate::events::Log;
use crate::exhausted::signal_text;
use crate::plan::PlannedStage;
use ipc::{IpcError, LatestPublisher, LatestSubscriber, Node, Waker};
use rustix::process::{Pid, Signal, kill_process_group};
use stage::LOG_FORMAT;
use stage::assignment::{Command as StageCommand, wake_name};
use stage::exit;
use stage::health::Health;
use std::fs::OpenOptions;
use std::io::{Read, Seek, SeekFrom};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Instant;

/// Lines of a log that a failure report shows.
const LAST_WORDS: usize = 20;
/// Bytes from the end of a log in which these lines are looked for.
const LAST_BYTES: u64 = 16 << 10;

/// A running stage.
pub struct StageProcess {
    /// Its table.
    pub name: String,
    child: Child,
    log: PathBuf,
    /// Length of the log when this process was started: what comes before are others' words.
    log_start: u64,
    control: LatestPublisher,
    wake: Waker,
    told: StageCommand,
    heartbeat: LatestSubscriber,
    /// The last heartbeat.
    pub health: Health,
    /// When the last heartbeat came, or the process was started.
    pub last_beat: Instant,
    /// When `health.progress_mark` last rose.
    pub last_progress: Instant,
    /// Set once it has ended.
    pub status: Option<ExitStatus>,
    /// Live: it has failed and waits to be started anew.
    pub is_down: bool,
}

impl StageProcess {
    /// Starts the program in a process group of its own, so that a Ctrl-C at the terminal reaches the supervisor alone.
    pub fn start(
        stage: &PlannedStage,
        assignment: &Path,
        log: PathBuf,
        format: Log,
        node: &Node,
    ) -> Result<Self, String> {
        let failed = |error: String| format!("[{}] {}: {error}", stage.name, stage.program.display());
        let control = LatestPublisher::open(node, &format!("{}.control", stage.name))
            .map_err(|error| failed(error.to_string()))?;
        let wake = Waker::open(node, &wake_name(&stage.name)).map_err(|error| failed(error.to_string()))?;
        let heartbeat = LatestSubscriber::open(node, &format!("{}.health", stage.name))
            .map_err(|error| failed(error.to_string()))?;
        let (child, log_start) = spawn(stage, assignment, &log, format)?;
        let now = Instant::now();
        Ok(Self {
            name: stage.name.clone(),
            child,
            log_start,
            log,
            control,
            wake,
            told: StageCommand::default(),
            heartbeat,
            health: Health::default(),
            last_beat: now,
            last_progress: now,
            status: None,
            is_down: false,
        })
    }

    /// Starts the stage anew after its process has ended. The supervisor's ends of its services stay.
    pub fn start_again(&mut self, stage: &PlannedStage, assignment: &Path, format: Log) -> Result<(), String> {
        let (child, log_start) = spawn(stage, assignment, &self.log, format)?;
        let now = Instant::now();
        (self.child, self.log_start) = (child, log_start);
        (self.last_beat, self.last_progress) = (now, now);
        (self.health, self.status, self.is_down) = (Health::default(), None, false);
        Ok(())
    }

    /// Takes in the exit status and the latest heartbeat.
    pub fn observe(&mut self) -> Result<(), IpcError> {
        // The status first: a heartbeat sent before the end is then surely seen.
        if self.status.is_none() {
            self.status = self.child.try_wait().ok().flatten();
        }
        if let Some(health) = self.heartbeat.poll()?.and_then(|bytes| serde_json::from_slice::<Health>(&bytes).ok()) {
            let now = Instant::now();
            self.last_beat = now;
            if health.progress_mark != self.health.progress_mark || health.activity != self.health.activity {
                self.last_progress = now;
            }
            self.health = health;
        }
        Ok(())
    }

    /// Says what is to be done, again and again; wakes it for what is new.
    pub fn tell(&mut self, command: StageCommand) -> Result<(), IpcError> {
        let command = StageCommand { heard: self.health.beat > 0, ..command };
        let text = serde_json::to_vec(&command).unwrap_or_default();
        self.control.publish(&text)?;
        if command != self.told {
            self.wake.ring();
            self.told = command;
        }
        Ok(())
    }

    /// Signals the stage and whatever it has started.
    pub fn signal(&self, signal: Signal) {
        if self.status.is_none()
            && let Some(group) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw)
        {
            // It may just have ended by itself.
            let _ = kill_process_group(group, signal);
        }
    }

    /// Kills and waits.
    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
        if self.status.is_none() {
            self.status = self.child.wait().ok();
        }
    }

    /// How it ended, in words.
    pub fn ending(&self) -> String {
        match self.status {
            None => "is running".to_owned(),
            Some(status) => match (status.code(), status.signal()) {
                (Some(101), _) => "panicked (exit code 101)".to_owned(),
                (Some(code), _) if code == i32::from(exit::CONFIGURATION) => {
                    format!("refused its configuration (exit code {code})")
                }
                (Some(code), _) => format!("ended with exit code {code}"),
                (None, Some(signal)) => format!("was killed by {}", signal_text(signal)),
                (None, None) => "ended".to_owned(),
            },
        }
    }

    /// The last lines of its log, and why it failed if that could not be logged.
    pub fn last_words(&self) -> Vec<String> {
        let mut text = Vec::new();
        if let Ok(mut file) = std::fs::File::open(&self.log) {
            let length = file.metadata().map_or(0, |metadata| metadata.len());
            let _ = file.seek(SeekFrom::Start(self.log_start.max(length.saturating_sub(LAST_BYTES))));
            let _ = file.read_to_end(&mut text);
        }
        let text = String::from_utf8_lossy(&text).into_owned();
        // A backtrace would crowd out what it was printed for; the log has it.
        let lines: Vec<&str> = text.lines().filter(|line| !is_stack_frame(line)).collect();
        let last = &lines[lines.len().saturating_sub(LAST_WORDS)..];
        let unsaid = self.health.error.as_deref().filter(|error| !text.contains(*error));
        last.iter().copied().chain(unsaid).map(str::to_owned).collect()
    }
}

/// Starts the program; its log is appended to. The length of the log before.
fn spawn(stage: &PlannedStage, assignment: &Path, log: &Path, format: Log) -> Result<(Child, u64), String> {
    let failed = |error: std::io::Error| format!("[{}] {}: {error}", stage.name, stage.program.display());
    let file = OpenOptions::new().create(true).append(true).open(log).map_err(failed)?;
    let mut command = Command::new(&stage.program);
    command.arg("run").arg(assignment).stdin(Stdio::null()).process_group(0);
    if stage.table.threads > 0 {
        command.env("RAYON_NUM_THREADS", stage.table.threads.to_string());
    }
    if format == Log::Json {
        command.env(LOG_FORMAT, "json");
    }
    let log_start = file.metadata().map_or(0, |metadata| metadata.len());
    let stdout = file.try_clone().map_err(failed)?;
    let child = command.stdout(stdout).stderr(file).spawn().map_err(failed)?;
    Ok((child, log_start))
}

/// `   7: some::function`, `             at src/file.rs:3:5`, or the head of such lines.
fn is_stack_frame(line: &str) -> bool {
    let text = line.trim_start();
    let is_indented = text.len() < line.len();
    let is_numbered = text.split_once(": ").is_some_and(|(number, _)| number.parse::<u32>().is_ok());
    text == "stack backtrace:" || (is_indented && (is_numbered || text.starts_with("at ")))
}

#[cfg(test)]
mod tests {
    use super::is_stack_frame;

    #[test]
    fn frames_are_told_from_words() {
        for frame in ["   7: core::ops::function", "             at /rustc/library/core.rs:1:2", "stack backtrace:"] {
            assert!(is_stack_frame(frame), "{frame}");
        }
        for words in ["memory allocation of 9 bytes failed", "7: not indented", "at the end", "  at", ""] {
            assert!(!is_stack_frame(words), "{words}");
        }
    }
}
