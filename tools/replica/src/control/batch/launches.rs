//! Starts of `replica-launch` for the drives of a batch.

use super::drives::BatchDrive;
use anyhow::Context;
use files::regular_file;
use run::process::sibling;
use run::summary::{REPORT_FILES, Summary};
use run::{Outcome, exit};
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// Interval between two checks of the run: far below the time of the shortest run.
const POLL: Duration = Duration::from_millis(20);

/// How a drive starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Its output has no run.
    New,
    /// Its output has an unfinished run with the same settings, programs and files.
    Resume,
    /// The results in its output are replaced.
    Overwrite,
    /// Its output has the results of a finished run with the same settings, programs and files.
    DoneBefore,
}

/// Starts one run after another.
pub struct Launches {
    program: PathBuf,
    /// Launch file, `--set` and `--without`.
    arguments: Vec<std::ffi::OsString>,
    /// Longest wait for another run into the same output, s.
    wait_s: u32,
    signals: Signals,
    must_stop: bool,
}

/// Why a drive does not start.
#[derive(Debug)]
pub struct Refusal {
    /// The drive and the message of `replica-launch`.
    pub text: String,
    /// Whether the output has results of other settings: `--overwrite` would replace them.
    pub is_of_other_settings: bool,
}

impl Launches {
    /// Prepares the arguments that all runs have in common.
    pub fn new(launch_file: &Path, overrides: &[String], without: &[String], wait_s: u32) -> anyhow::Result<Self> {
        let launch_file = std::path::absolute(launch_file).context("the launch file")?;
        let mut arguments = vec![launch_file.into()];
        for (option, values) in [("--set", overrides), ("--without", without)] {
            arguments.extend(values.iter().flat_map(|value| [option.into(), value.into()]));
        }
        Ok(Self {
            program: sibling("replica-launch").map_err(anyhow::Error::msg)?,
            arguments,
            wait_s,
            signals: Signals::new([SIGINT, SIGTERM, SIGHUP, SIGQUIT]).context("signals cannot be received")?,
            must_stop: false,
        })
    }

    /// Whether the end of the batch was requested.
    pub fn must_stop(&mut self) -> bool {
        self.must_stop |= self.signals.pending().count() > 0;
        self.must_stop
    }

    /// How the drive starts; `Err` if its output must be kept. `replica-launch` decides, as it does for `--resume`.
    pub fn start_of(&mut self, drive: &BatchDrive) -> anyhow::Result<Result<Start, Refusal>> {
        if !drive.output.exists() {
            return Ok(Ok(Start::New));
        }
        // A file, not a pipe, whose reader would have to read while it waits.
        let mut messages = tempfile::tempfile().context("a temporary file")?;
        let mut command = self.command(drive);
        command.args(["--resume", "--check"]).stdout(Stdio::null()).stderr(messages.try_clone()?);
        let status = self.run_to_end(&mut command)?;
        if status.signal().is_some() && self.must_stop {
            // The check waited for another run. The drive starts another time.
            return Ok(Ok(Start::Resume));
        }
        if !status.success() {
            let mut text = Vec::new();
            messages.seek(SeekFrom::Start(0)).and_then(|_| messages.read_to_end(&mut text))?;
            let text = format!("{}: {}", drive.name, String::from_utf8_lossy(&text).trim());
            let is_of_other_settings = status.code() == Some(i32::from(exit::CONFIGURATION));
            return Ok(Err(Refusal { text, is_of_other_settings }));
        }
        let is_done = Summary::load(&drive.output).is_ok_and(|summary| summary.outcome == Outcome::Done);
        let is_complete = is_done && !lacks_end(&drive.output);
        Ok(Ok(if is_complete { Start::DoneBefore } else { Start::Resume }))
    }

    /// Runs the drive to its end. Signals to this process go to the run.
    pub fn run(&mut self, drive: &BatchDrive, start: Start) -> anyhow::Result<ExitStatus> {
        let option = match start {
            Start::New | Start::DoneBefore => None,
            Start::Resume => Some("--resume"),
            Start::Overwrite => Some("--overwrite"),
        };
        // A continued run continues its log.
        let mut log = File::options();
        let log = if start == Start::Resume { log.append(true) } else { log.write(true).truncate(true) };
        let log = log.create(true).open(&drive.log).with_context(|| drive.log.display().to_string())?;
        let mut command = self.command(drive);
        command.args(option).stdout(log.try_clone()?).stderr(log);
        self.run_to_end(&mut command)
    }

    /// Runs a command to its end. Signals to this process go to it.
    fn run_to_end(&mut self, command: &mut Command) -> anyhow::Result<ExitStatus> {
        let mut child = command.spawn().with_context(|| self.cannot_start())?;
        loop {
            for signal in self.signals.pending() {
                self.must_stop = true;
                forward(signal, &child);
            }
            if let Some(status) = child.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(POLL);
        }
    }

    fn command(&self, drive: &BatchDrive) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        for (key, path) in [("run.drive", &drive.path), ("run.output", &drive.output)] {
            command.arg("--set").arg(format!("{key}={}", path.display()));
        }
        if self.wait_s > 0 {
            command.arg("--wait").arg(self.wait_s.to_string());
        }
        // A killed batch also ends its run, so that the next batch can continue the run.
        command.arg("--end-with").arg(std::process::id().to_string()).stdin(Stdio::null());
        // Ctrl-C reaches this process alone, which forwards it: a run that received it twice would not drain.
        command.process_group(0);
        command
    }

    fn cannot_start(&self) -> String {
        format!("cannot start {}", self.program.display())
    }
}

/// Whether the supervisor was killed between the summary and its end: it has left states, or no report. Resuming the run
/// makes up for both.
fn lacks_end(output: &Path) -> bool {
    let has_states = std::fs::read_dir(output.join("run/states")).is_ok_and(|mut states| states.next().is_some());
    let has_report = REPORT_FILES.iter().all(|name| output.join(name).exists());
    let settings = regular_file::read(output.join("run/settings.json")).unwrap_or_default();
    let settings: serde_json::Value = serde_json::from_slice(&settings).unwrap_or_default();
    has_states || !has_report && settings["run"]["report"] == true
}

/// Sends a signal to a child that was not waited for yet, so its process id is its own.
fn forward(signal: i32, child: &Child) {
    let signal = match signal {
        SIGINT => Signal::INT,
        SIGHUP => Signal::HUP,
        SIGQUIT => Signal::QUIT,
        _ => Signal::TERM,
    };
    // It may have ended.
    let _ = kill_process(Pid::from_child(child), signal);
}
