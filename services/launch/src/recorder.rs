//! `replica record` alongside the run.

use crate::plan::Plan;
use run::process::{ProgramMissing, sibling};
use run::{Outcome, exit};
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longest wait at the end of the run: the recorder still writes a queue of messages and an index, which takes long on
/// a slow disk.
const FINISH_TIMEOUT: Duration = Duration::from_mins(1);

/// A recording that was not started or is not complete.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// The program is not in the folder of this one.
    #[error(transparent)]
    Program(#[from] ProgramMissing),
    /// The program cannot be started.
    #[error("{program} record: cannot be started: {source}")]
    Start {
        /// The program.
        program: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The recorder succeeded, but messages are missing.
    #[error("the recording {file} is not complete; the run is {outcome}")]
    Incomplete {
        /// The recording.
        file: PathBuf,
        /// Outcome of the run.
        outcome: Outcome,
    },
    /// The recorder failed.
    #[error("the recording {file} failed: {status}")]
    Failed {
        /// The recording.
        file: PathBuf,
        /// Exit status of the recorder.
        status: ExitStatus,
    },
    /// The recorder did not end.
    #[error("the recorder of {file} did not finish within {} s", FINISH_TIMEOUT.as_secs())]
    Timeout {
        /// The recording.
        file: PathBuf,
    },
}

/// The recorder's process. If it dies, the run continues without it.
pub struct Recorder {
    output: PathBuf,
    file: PathBuf,
    topics: String,
    child: Option<Child>,
    /// Number of attempts to which it has attached.
    ready: Arc<AtomicU64>,
    /// Number of started attempts.
    attempts: u64,
    ended: Option<ExitStatus>,
    is_reported: bool,
}

impl Recorder {
    /// A recorder for the plan's run, not started yet.
    pub fn new(plan: &Plan, file: PathBuf) -> Self {
        Self {
            output: plan.context.output.clone(),
            file,
            topics: plan.selection.recorded.join(","),
            child: None,
            ready: Arc::default(),
            attempts: 0,
            ended: None,
            is_reported: false,
        }
    }

    /// A new attempt of the run has been wired. The recorder is started with the first one and finds later ones by itself.
    pub fn start(&mut self, attempt: u32) -> Result<(), RecorderError> {
        self.attempts = u64::from(attempt) + 1;
        if self.child.is_some() {
            return Ok(());
        }
        let program = sibling("replica")?;
        let failed = |source: std::io::Error| RecorderError::Start { program: program.clone(), source };
        let mut child = Command::new(&program)
            .arg("record")
            .arg(&self.output)
            .args(["--topics", &self.topics])
            .arg(&self.file)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            // A Ctrl-C at the terminal is for the supervisor; the recorder ends with the run.
            .process_group(0)
            .spawn()
            .map_err(failed)?;
        let stdout = child.stdout.take();
        let ready = Arc::clone(&self.ready);
        self.child = Some(child);
        let listen = move || {
            for line in stdout.into_iter().flat_map(|stdout| BufReader::new(stdout).lines()).map_while(Result::ok) {
                if let Some(attempt) = line.strip_prefix("ready ").and_then(|attempt| attempt.parse::<u64>().ok()) {
                    ready.store(attempt + 1, Ordering::Release);
                }
            }
        };
        std::thread::Builder::new().name("recorder".to_owned()).spawn(listen).map(drop).map_err(failed)
    }

    /// Reads the recorder's exit status.
    pub fn observe(&mut self) {
        if let Some(child) = &mut self.child
            && self.ended.is_none()
        {
            self.ended = child.try_wait().ok().flatten();
        }
    }

    /// Whether sources may start: the recorder is attached, or it has ended.
    pub fn is_ready(&self) -> bool {
        self.ended.is_some() || self.ready.load(Ordering::Acquire) >= self.attempts
    }

    /// Logs once that the recorder has ended in the middle of the run.
    pub fn report_end(&mut self) {
        if let Some(status) = self.ended.filter(|status| !status.success() && !self.is_reported) {
            self.is_reported = true;
            let file = self.file.display();
            tracing::warn!("the recorder of {file} ended ({status}); the run continues without it");
        }
    }

    /// Waits until the recorder has written everything.
    pub fn finish(mut self, outcome: Outcome) -> Result<(), RecorderError> {
        let Some(child) = &mut self.child else { return Ok(()) };
        if !outcome.is_in_order() {
            // The last tick never comes; the recorder writes the data it has, as after Ctrl-C. It may have ended
            // already.
            let _ = kill_process(Pid::from_child(child), Signal::TERM);
        }
        let begun = Instant::now();
        while self.ended.is_none() && begun.elapsed() < FINISH_TIMEOUT {
            self.ended = child.try_wait().ok().flatten();
            std::thread::sleep(Duration::from_millis(5));
        }
        let file = self.file;
        match self.ended {
            Some(status) if status.success() => Ok(()),
            Some(status) if status.code() == Some(i32::from(exit::INCOMPLETE)) => {
                Err(RecorderError::Incomplete { file, outcome })
            }
            Some(status) => Err(RecorderError::Failed { file, status }),
            None => {
                // Whether or not it can be killed, there is no end to wait for.
                let _ = child.kill().and_then(|()| child.wait());
                Err(RecorderError::Timeout { file })
            }
        }
    }
}
