//! Finding a run, asking its supervisor, and looking into it, through its restarts, until it ends.

mod ask;
mod tap;

pub use tap::{Tap, TapEvent};

use anyhow::{Context, bail};
use ipc::{Domain, IpcError, Node, Visit};
use stage::assignment::TopicChannels;
use stage::process::open_files;
use stage::wiring::Wiring;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Between two looks at something that may have changed.
const LOOK: Duration = Duration::from_millis(20);
/// Places of onlookers that died are free again after a second, and an attempt has all its services a moment after the first; a run
/// that refuses for longer is full.
const ATTACH_PATIENCE: Duration = Duration::from_secs(10);
/// A supervisor that was killed leaves its domain as it is: whether it lives is looked at by itself.
const LOOK_AT_SUPERVISOR: Duration = Duration::from_millis(500);
/// A domain that is being wiped fails before it is gone; what fails for longer fails by itself.
const WIPE_PATIENCE: Duration = Duration::from_secs(5);
/// What the kernel calls a supervisor.
const SUPERVISOR: &str = "replica-launch";

/// Words on the command line that do not fit the run.
#[derive(Debug)]
pub struct Usage(pub String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// Which run is meant.
#[derive(Clone, Debug, clap::Args)]
pub struct RunArgument {
    /// Output folder of the run [default: the one run that is alive].
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
}

impl RunArgument {
    /// The run into this folder.
    pub fn of(output: &Path) -> Self {
        Self { run: Some(output.to_owned()) }
    }

    /// Whether nothing was said.
    pub fn is_default(&self) -> bool {
        self.run.is_none()
    }

    /// The run, alive or not.
    pub fn find(&self) -> anyhow::Result<Run> {
        if let Some(output) = &self.run {
            return Run::read(output);
        }
        let alive = alive_outputs();
        match alive.as_slice() {
            [] => bail!("no run is alive on this machine; name the output folder of one with --run DIR"),
            [output] => Run::read(output),
            several => {
                let list: Vec<String> =
                    several.iter().map(|output| format!("\n  --run {}", output.display())).collect();
                Err(Usage(format!("{} runs are alive; name one of them:{}", several.len(), list.concat())).into())
            }
        }
    }

    /// The run, if it is alive.
    pub fn find_alive(&self) -> anyhow::Result<Run> {
        let run = self.find()?;
        if !run.is_alive() {
            bail!(
                "the run in {} is not alive (its supervisor was process {})",
                run.output.display(),
                run.wiring.supervisor
            );
        }
        Ok(run)
    }
}

/// Output folders of all runs of this user that are alive: where a supervisor holds `run/lock` open.
fn alive_outputs() -> Vec<PathBuf> {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = processes.filter_map(|entry| entry.file_name().to_string_lossy().parse::<u32>().ok());
    let supervisors = pids.filter(|pid| {
        std::fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|name| name.trim_end() == SUPERVISOR)
    });
    let mut outputs: Vec<PathBuf> = supervisors
        .flat_map(open_files)
        .filter(|file| file.ends_with("run/lock"))
        .filter_map(|file| Some(file.parent()?.parent()?.to_owned()))
        .filter(|output| Run::read(output).is_ok_and(|run| run.is_alive()))
        .collect();
    outputs.sort();
    outputs
}

/// A run and what its supervisor wrote about it.
pub struct Run {
    /// Its output folder, absolute.
    pub output: PathBuf,
    /// Its latest wiring.
    pub wiring: Wiring,
    /// The attempt that was visited last. What was opened in it is over when the next visit is due.
    visited: Option<u32>,
    looked_at_supervisor: Instant,
}

impl Run {
    fn read(output: &Path) -> anyhow::Result<Self> {
        let wiring = Wiring::read(output).map_err(anyhow::Error::msg)?;
        let output = output.canonicalize().with_context(|| output.display().to_string())?;
        Ok(Self { output, wiring, visited: None, looked_at_supervisor: Instant::now() })
    }

    /// Whether the supervisor that wrote the wiring is at work.
    pub fn is_alive(&self) -> bool {
        self.wiring.is_alive(&self.output)
    }

    /// The topic called `name`.
    pub fn topic(&self, name: &str) -> anyhow::Result<&stage::wiring::WiredTopic> {
        self.wiring.topic(name).map_err(|error| Usage(error).into())
    }

    /// The run's world in shared memory.
    pub fn domain(&self) -> anyhow::Result<Domain> {
        Ok(Domain::new(&self.wiring.domain)?)
    }

    /// Opens in the run's domain what `open` does, as soon as the run has one: between two attempts it has none.
    /// `None` if the run has ended, or if `stop` says so.
    pub fn visit<T>(
        &mut self,
        open: impl Fn(&Node, &Wiring) -> Result<T, IpcError>,
        stop: impl Fn() -> bool,
    ) -> anyhow::Result<Option<Visit<T>>> {
        let mut refused_since = None;
        while self.is_alive() && !stop() {
            self.wiring = Wiring::read(&self.output).map_err(anyhow::Error::msg)?;
            if self.visited == Some(self.wiring.attempt) {
                std::thread::sleep(LOOK);
                continue;
            }
            let domain = self.domain()?;
            match domain.visit("onlooker", |node| open(node, &self.wiring)) {
                // The supervisor announces an attempt before it makes its services. Those that were found are of this one
                // only if it has not announced another since.
                Ok(visit) if Wiring::read(&self.output).as_ref() == Ok(&self.wiring) => {
                    self.visited = Some(self.wiring.attempt);
                    return Ok(Some(visit));
                }
                Err(_) if !domain.root().exists() => refused_since = None,
                Err(error) if refused_since.get_or_insert_with(Instant::now).elapsed() > ATTACH_PATIENCE => {
                    return Err(error).context(
                        "the run lets three look on at a topic, one of them lossless: it has no place for another",
                    );
                }
                _ => {}
            }
            std::thread::sleep(LOOK);
        }
        Ok(None)
    }

    /// Whether nothing more can come from where `visit` looks. Asked before a look: what came up to the end is then surely
    /// seen.
    pub fn is_over<T>(&mut self, visit: &Visit<T>) -> bool {
        if !visit.is_current() {
            return true;
        }
        if self.looked_at_supervisor.elapsed() < LOOK_AT_SUPERVISOR {
            return false;
        }
        self.looked_at_supervisor = Instant::now();
        !self.is_alive()
    }

    /// Forgives an error of the transport if the attempt in which it came up is over, which shows soon.
    pub fn excuse<T>(&self, visit: &Visit<T>, error: IpcError) -> Result<(), IpcError> {
        let begun = Instant::now();
        while visit.is_current() && self.is_alive() {
            if begun.elapsed() > WIPE_PATIENCE {
                return Err(error);
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }
}

/// The channels of a topic, for what is opened during a visit.
pub fn channels<'a>(wiring: &'a Wiring, topic: &str) -> Result<&'a TopicChannels, IpcError> {
    let wired = wiring.topic(topic).map_err(|cause| IpcError::Transport { what: "wiring".to_owned(), cause })?;
    Ok(&wired.channels)
}
