//! Runs a launch file on a number of cores.

use super::configuration::Configuration;
use super::profile;
use anyhow::Context;
use run::process::sibling;
use run::summary::Summary;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::path::Path;
use std::process::{Command, Stdio};

/// Reason for a missing summary.
pub enum Failure {
    /// The run ended with this exit code. It has printed the reason.
    Ended(u8),
    /// The run did not start, or left no summary.
    Other(anyhow::Error),
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Failure::Other(error)
    }
}

/// Runs the launch file into `output`; under `perf`, if a file for its recording is given.
pub fn measure(
    launch_file: &Path,
    overrides: &[String],
    configuration: Configuration,
    output: &Path,
    perf_data: Option<&Path>,
) -> Result<Summary, Failure> {
    let program = sibling("replica-launch").map_err(anyhow::Error::msg)?;
    let mut command = perf_data.map_or_else(|| Command::new(&program), |data| profile::recording(data, &program));
    command.arg(launch_file).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    for setting in overrides {
        command.args(["--set", setting]);
    }
    // Each run starts in an empty folder, so that no run reads or replaces files of another.
    let folder = output.join("results");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    command.args(["--set", &format!("run.output={}", folder.display())]);
    let child = on_cores(configuration.cores, || command.spawn().context("cannot start replica-launch"))?;
    let ended = child.wait_with_output().context("replica-launch")?;
    // Doubts about the result of a run do not change its times.
    if !matches!(ended.status.code(), Some(0 | 3)) {
        eprint!("{}", String::from_utf8_lossy(&ended.stderr));
        // A run that was ended by a signal has no exit code.
        return Err(Failure::Ended(ended.status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)));
    }
    let mut summary = Summary::load(&folder).map_err(anyhow::Error::from)?;
    // Reports are also read on other machines, where only the names of the programs have a meaning.
    for stage in &mut summary.stages {
        let name = Path::new(&stage.program).file_name().map(|name| name.to_string_lossy().into_owned());
        stage.program = name.unwrap_or_default();
    }
    Ok(summary)
}

/// Calls `start` with this thread limited to the first `n` of its cores. A child process inherits this limit.
fn on_cores<T>(n: usize, start: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let all = sched_getaffinity(None).context("cannot read the CPU affinity")?;
    let mut some = CpuSet::new();
    for core in (0..CpuSet::MAX_CPU).filter(|core| all.is_set(*core)).take(n) {
        some.set(core);
    }
    sched_setaffinity(None, &some).with_context(|| format!("cannot limit to {n} cores"))?;
    let started = start();
    sched_setaffinity(None, &all).context("cannot restore the CPU affinity")?;
    started
}
