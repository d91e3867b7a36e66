//! The option `--run`, and the search for runs that are alive.

use super::run_handle::Run;
use anyhow::bail;
use command_line::usage_error::UsageError;
use run::process::open_files;
use std::path::{Path, PathBuf};

/// Name of the supervisor's process.
const SUPERVISOR: &str = "replica-launch";

/// Selects a run.
#[derive(Clone, Debug, clap::Args)]
pub struct RunArgument {
    /// Output folder of the run [default: the only running one of this user]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
}

impl RunArgument {
    /// The run with this output folder.
    pub fn from_output(output: &Path) -> Self {
        Self { run: Some(output.to_owned()) }
    }

    /// Whether `--run` was not given.
    pub fn is_default(&self) -> bool {
        self.run.is_none()
    }

    /// The run, alive or ended.
    pub fn find(&self) -> anyhow::Result<Run> {
        if let Some(output) = &self.run {
            return Run::read(output);
        }
        let alive = alive_outputs();
        match alive.as_slice() {
            [] => bail!("no run is alive on this machine\nhint: --run DIR selects a run by its output folder"),
            [output] => Run::read(output),
            several => {
                let list: Vec<String> =
                    several.iter().map(|output| format!("\n  --run {}", output.display())).collect();
                Err(UsageError(format!("{} runs are alive; select one of them:{}", several.len(), list.concat()))
                    .into())
            }
        }
    }

    /// The run, if it is alive.
    pub fn find_alive(&self) -> anyhow::Result<Run> {
        let run = self.find()?;
        if !run.is_alive() {
            bail!(
                "the run in {} is not alive: its supervisor, process {}, has ended",
                run.output.display(),
                run.wiring.supervisor
            );
        }
        Ok(run)
    }
}

/// Output folders of all runs of this user that are alive. The supervisor of such a run holds `run/lock` open.
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
