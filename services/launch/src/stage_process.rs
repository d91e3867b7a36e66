//! One stage's process: started, observed, commanded, killed.

mod log_tail;
mod starvation;

use crate::decision::ObservedStage;
use crate::log::LogFormat;
use crate::plan::PlannedStage;
use ipc::{IpcError, LatestPublisher, LatestSubscriber, Node, Waker};
use run::LOG_FORMAT;
use run::assignment::{Command as StageCommand, wake_name};
use run::health::Health;
use run::process::stage_command;
use rustix::process::{Pid, Signal, kill_process_group};
use starvation::Starvation;
use std::fs::OpenOptions;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// A stage without progress for this long is observed for lack of processor time; most steps are far shorter.
const OBSERVED_AFTER: Duration = Duration::from_secs(1);
/// Time without a processor that an operator should know about.
const REPORTED_STARVATION: Duration = Duration::from_secs(10);

/// A stage that cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Its program cannot be started, or its log cannot be opened.
    #[error("[{stage}] {program}: cannot be started: {source}")]
    Program {
        /// Its table.
        stage: String,
        /// Its binary.
        program: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The supervisor's ends of its services cannot be opened.
    #[error("[{stage}]: {source}")]
    Services {
        /// Its table.
        stage: String,
        /// The error of the transport.
        source: IpcError,
    },
}

/// A stage's process.
pub struct StageProcess {
    /// Its table.
    pub name: String,
    child: Child,
    log: PathBuf,
    /// Length of the log when this process was started; earlier lines are of earlier processes.
    log_start: u64,
    control: LatestPublisher,
    wake: Waker,
    last_command: StageCommand,
    heartbeat: LatestSubscriber,
    /// The last heartbeat.
    pub health: Health,
    last_heartbeat: Instant,
    last_progress: Instant,
    starvation: Starvation,
    /// Time without a processor since its last heartbeat.
    starved_since_heartbeat: Duration,
    /// Time without a processor since its last progress.
    starved_since_progress: Duration,
    is_starvation_reported: bool,
    heartbeat_error: Option<String>,
    /// Set once the process has ended.
    pub status: Option<ExitStatus>,
    /// Live: the stage has failed, and its restart is due later.
    pub awaits_restart: bool,
}

impl StageProcess {
    /// Starts the program in its own process group, so that a Ctrl-C at the terminal reaches only the supervisor.
    pub fn start(
        stage: &PlannedStage,
        assignment: &Path,
        log: PathBuf,
        format: LogFormat,
        node: &Node,
    ) -> Result<Self, StartError> {
        let failed = |source: IpcError| StartError::Services { stage: stage.name.clone(), source };
        let control = LatestPublisher::open(node, &format!("{}.control", stage.name)).map_err(failed)?;
        let wake = node.open_waker(&wake_name(&stage.name)).map_err(failed)?;
        let heartbeat = LatestSubscriber::open(node, &format!("{}.health", stage.name)).map_err(failed)?;
        let Spawned { child, log_start } = spawn(stage, assignment, &log, format)?;
        let now = Instant::now();
        Ok(Self {
            name: stage.name.clone(),
            child,
            log_start,
            log,
            control,
            wake,
            last_command: StageCommand::default(),
            heartbeat,
            health: Health::default(),
            last_heartbeat: now,
            last_progress: now,
            starvation: Starvation::default(),
            starved_since_heartbeat: Duration::ZERO,
            starved_since_progress: Duration::ZERO,
            is_starvation_reported: false,
            heartbeat_error: None,
            status: None,
            awaits_restart: false,
        })
    }

    /// Restarts the stage after its process has ended. The supervisor's ends of its services stay open.
    pub fn restart(&mut self, stage: &PlannedStage, assignment: &Path, format: LogFormat) -> Result<(), StartError> {
        let Spawned { child, log_start } = spawn(stage, assignment, &self.log, format)?;
        let now = Instant::now();
        self.child = child;
        self.log_start = log_start;
        self.hear(now);
        self.progress(now);
        self.health = Health::default();
        self.status = None;
        self.awaits_restart = false;
        Ok(())
    }

    /// Reads the exit status and the latest heartbeat.
    pub fn observe(&mut self) {
        // Read the status first: then the last heartbeat before an exit has certainly been read.
        if self.status.is_none() {
            self.status = self.child.try_wait().ok().flatten();
        }
        let beat = self.heartbeat.poll();
        self.heartbeat_error = beat.as_ref().err().map(ToString::to_string);
        let health = beat.ok().flatten().and_then(|bytes| serde_json::from_slice::<Health>(&bytes).ok());
        if let Some(health) = health {
            let now = Instant::now();
            self.hear(now);
            if health.progress_mark != self.health.progress_mark || health.activity != self.health.activity {
                self.progress(now);
            }
            self.health = health;
        }
        if self.status.is_none() && self.last_progress.elapsed() > OBSERVED_AFTER {
            let starved = self.starvation.look(self.child.id());
            self.starved_since_heartbeat += starved;
            self.starved_since_progress += starved;
            self.report_starvation();
        }
    }

    /// Warns once: the operator can end other programs.
    fn report_starvation(&mut self) {
        let starved_s = self.starved_since_progress.as_secs_f64();
        if self.starved_since_progress > REPORTED_STARVATION
            && !std::mem::replace(&mut self.is_starvation_reported, true)
        {
            let load = starvation::load();
            tracing::warn!(
                starved_s,
                "[{}] has waited {starved_s:.0} s for a processor since its last progress ({load}): the run is slow, but no \
                 result changes; end other programs, or give the run processors of its own (taskset)",
                self.name
            );
        }
    }

    fn hear(&mut self, now: Instant) {
        self.last_heartbeat = now;
        self.starved_since_heartbeat = Duration::ZERO;
    }

    fn progress(&mut self, now: Instant) {
        self.last_progress = now;
        self.starved_since_progress = Duration::ZERO;
        self.starvation = Starvation::default();
    }

    /// The last observations of [`StageProcess::observe`], with times since `origin`.
    pub fn observed(&self, origin: Instant) -> ObservedStage {
        ObservedStage {
            name: self.name.clone(),
            exit: self.status.map(Into::into),
            activity: self.health.activity.clone(),
            ticks: self.health.ticks,
            last_heartbeat: self.last_heartbeat - origin,
            last_progress: self.last_progress - origin,
            starved_since_heartbeat: self.starved_since_heartbeat,
            starved_since_progress: self.starved_since_progress,
            heartbeat_error: self.heartbeat_error.clone(),
            awaits_restart: self.awaits_restart,
        }
    }

    /// Publishes the command again, and wakes the stage if the command is new.
    pub fn command(&mut self, command: StageCommand) -> Result<(), IpcError> {
        let command = StageCommand { heard: self.health.beat > 0, ..command };
        let text = serde_json::to_vec(&command).unwrap_or_default();
        self.control.publish(&text)?;
        if command != self.last_command {
            self.wake.wake();
            self.last_command = command;
        }
        Ok(())
    }

    /// Signals the stage and the processes that it has started.
    pub fn signal(&self, signal: Signal) {
        if self.status.is_none()
            && let Some(group) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw)
        {
            // It may have ended in the meantime.
            let _ = kill_process_group(group, signal);
        }
    }

    /// Kills the process and waits for its end.
    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
        if self.status.is_none() {
            self.status = self.child.wait().ok();
        }
    }

    /// The last lines of its log, and its error if that could not be logged.
    pub fn last_log_lines(&self) -> Vec<String> {
        log_tail::read(&self.log, self.log_start, self.health.error.as_deref())
    }
}

/// A started program.
struct Spawned {
    child: Child,
    /// Length of the log before.
    log_start: u64,
}

/// Starts the program, which appends to its log.
fn spawn(stage: &PlannedStage, assignment: &Path, log: &Path, format: LogFormat) -> Result<Spawned, StartError> {
    let failed = |source: std::io::Error| StartError::Program {
        stage: stage.name.clone(),
        program: stage.program.clone(),
        source,
    };
    let file = OpenOptions::new().create(true).append(true).open(log).map_err(failed)?;
    let mut command = stage_command(&stage.program, &stage.table.python, stage.table.threads);
    command.arg("run").arg(assignment).stdin(Stdio::null()).process_group(0);
    allocator::keep_freed_memory(&mut command, allocator::Keep::Sweeps);
    if format == LogFormat::Json {
        command.env(LOG_FORMAT, "json");
    }
    let log_start = file.metadata().map_or(0, |metadata| metadata.len());
    let stdout = file.try_clone().map_err(failed)?;
    let child = command.stdout(stdout).stderr(file).spawn().map_err(failed)?;
    Ok(Spawned { child, log_start })
}
