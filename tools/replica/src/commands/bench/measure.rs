//! One run of a launch file on so many cores.

use super::figures::{Configuration, Transport};
use anyhow::Context;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use stage::process::sibling;
use stage::summary::Summary;
use std::path::Path;
use std::process::{Command, Stdio};

/// Why there are no figures.
pub enum Failure {
    /// The run ended with this exit code, and has said why.
    Ended(u8),
    /// It could not even be run, or has left no summary.
    Other(anyhow::Error),
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Failure::Other(error)
    }
}

/// Runs the launch file into `output`.
pub fn measure(
    launch_file: &Path,
    overrides: &[String],
    configuration: Configuration,
    output: &Path,
) -> Result<Summary, Failure> {
    let transport = match configuration.transport {
        Transport::Shared => "shared",
        Transport::Copying => "copying",
    };
    let mut command = Command::new(sibling("replica-launch").map_err(anyhow::Error::msg)?);
    command.arg(launch_file).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    for setting in overrides {
        command.args(["--set", setting]);
    }
    command.args(["--set", &format!("run.transport={transport}")]);
    // What an earlier run has left would be read or replaced; each starts in an empty folder.
    let folder = output.join("results");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    command.args(["--set", &format!("run.output={}", folder.display())]);
    let child = on_cores(configuration.cores, || command.spawn().context("replica-launch cannot be started"))?;
    let ended = child.wait_with_output().context("replica-launch")?;
    if !ended.status.success() {
        eprint!("{}", String::from_utf8_lossy(&ended.stderr));
        // A run that a signal has ended has no code of its own.
        return Err(Failure::Ended(ended.status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)));
    }
    let path = folder.join("summary.json");
    let bytes = std::fs::read(&path).with_context(|| path.display().to_string())?;
    Ok(serde_json::from_slice(&bytes).with_context(|| path.display().to_string())?)
}

/// Starts something on the first `n` of the cores that this process may use. A child keeps what its parent's thread had.
fn on_cores<T>(n: usize, start: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let all = sched_getaffinity(None).context("cores of this process")?;
    let mut some = CpuSet::new();
    for core in (0..CpuSet::MAX_CPU).filter(|core| all.is_set(*core)).take(n) {
        some.set(core);
    }
    sched_setaffinity(None, &some).with_context(|| format!("{n} cores"))?;
    let started = start();
    sched_setaffinity(None, &all).context("all cores again")?;
    started
}
