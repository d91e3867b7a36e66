//! `replica record` beside the run.

use crate::plan::Plan;
use rustix::process::{Pid, Signal, kill_process};
use stage::exit;
use stage::process::sibling;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What the run has published is on its way to the disk when the run ends; a slow disk takes its time for a queue's
/// length of the largest messages and an index.
const FINISH_PATIENCE: Duration = Duration::from_mins(1);

/// The recorder's process. If it dies, the run goes on without it.
pub struct Recorder {
    output: PathBuf,
    file: PathBuf,
    topics: String,
    child: Option<Child>,
    /// Attempts for which it has said that it is attached.
    ready: Arc<AtomicU64>,
    /// Attempts that were started.
    attempts: u64,
    gone: Option<ExitStatus>,
    reported: bool,
}

impl Recorder {
    /// For the plan's run; nothing is started yet.
    pub fn of(plan: &Plan, file: PathBuf) -> Self {
        Self {
            output: plan.context.output.clone(),
            file,
            topics: plan.selection.recorded.join(","),
            child: None,
            ready: Arc::default(),
            attempts: 0,
            gone: None,
            reported: false,
        }
    }

    /// A new attempt of the run has been wired. The recorder is started with the first; later ones it finds by itself.
    pub fn start(&mut self, attempt: u32) -> Result<(), String> {
        self.attempts = u64::from(attempt) + 1;
        if self.child.is_some() {
            return Ok(());
        }
        let program = sibling("replica")?;
        let failed = |error: std::io::Error| format!("{} record: {error}", program.display());
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
        let (stdout, ready) = (child.stdout.take(), Arc::clone(&self.ready));
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

    /// Whether sources may begin: it is attached, or nobody need wait for it any more.
    pub fn is_ready(&mut self) -> bool {
        if let Some(child) = &mut self.child
            && self.gone.is_none()
        {
            self.gone = child.try_wait().ok().flatten();
        }
        self.gone.is_some() || self.ready.load(Ordering::Acquire) >= self.attempts
    }

    /// Once, if it has ended in the middle of the run: what is to be said.
    pub fn last_words(&mut self) -> Option<String> {
        let status = self.gone.filter(|status| !status.success() && !self.reported)?;
        self.reported = true;
        Some(format!("the recorder of {} ended ({status}); the run goes on without it", self.file.display()))
    }

    /// Waits until it has written everything. `Err`: what is wrong with the recording.
    pub fn finish(mut self, outcome: &str) -> Result<(), String> {
        let Some(child) = &mut self.child else { return Ok(()) };
        if matches!(outcome, "failed" | "stopped") {
            // The last tick never comes; it writes what has come, as after Ctrl-C. Without a process there is none to tell.
            let _ = kill_process(Pid::from_child(child), Signal::TERM);
        }
        let begun = Instant::now();
        while self.gone.is_none() && begun.elapsed() < FINISH_PATIENCE {
            self.gone = child.try_wait().ok().flatten();
            std::thread::sleep(Duration::from_millis(5));
        }
        let file = self.file.display();
        match self.gone {
            Some(status) if status.success() => Ok(()),
            Some(status) if status.code() == Some(i32::from(exit::INCOMPLETE)) => {
                Err(format!("the recording {file} is not complete; the run is {outcome}"))
            }
            Some(status) => Err(format!("the recording {file} failed: {status}")),
            None => {
                // Whether or not it can be killed, there is no end of it to wait for.
                let _ = child.kill().and_then(|()| child.wait());
                Err(format!("the recorder of {file} did not finish within {} s", FINISH_PATIENCE.as_secs()))
            }
        }
    }
}
