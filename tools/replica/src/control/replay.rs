//! `replica replay`: runs a launch file on a recording.

use anyhow::Context;
use run::process::sibling;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::str::FromStr;

/// Run a launch file on a recording.
///
/// The recording replaces the stages whose topics it contains. Stages that then lack an input or have no consumer are left out.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: as replica-launch\n\n\
                  Example: replica replay part.mcap --set run.output=out/replayed")]
pub struct Args {
    /// Recording (.mcap)
    recording: PathBuf,
    /// Launch file
    #[arg(long, default_value = "launch.toml")]
    launch: PathBuf,
    /// Topics to publish [default: all of the recording]
    #[arg(long, value_delimiter = ',')]
    topics: Vec<String>,
    /// Speed: a factor of the original speed (above 0, up to 1000), or max: as fast as the stages process
    #[arg(long, default_value = "max")]
    speed: Speed,
    /// Override a setting, e.g. --set run.output=out/replayed (may be repeated)
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
    /// Continue a killed replay into the same output folder from its last barrier
    #[arg(long)]
    resume: bool,
    /// Replace the results of an earlier run in the output folder
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Check the launch file, report all errors and start nothing
    #[arg(long)]
    check: bool,
}

/// The setting `replay.speed`: 0 means as fast as possible.
#[derive(Clone, Copy, Debug)]
struct Speed(f64);

#[derive(Debug, thiserror::Error)]
#[error("must be a factor above 0, up to 1000, or max")]
struct InvalidSpeed;

impl FromStr for Speed {
    type Err = InvalidSpeed;

    fn from_str(text: &str) -> Result<Self, InvalidSpeed> {
        if text == "max" {
            return Ok(Self(0.0));
        }
        let factor = text.parse().ok().filter(|factor: &f64| *factor > 0.0 && *factor <= 1000.0);
        factor.map(Self).ok_or(InvalidSpeed)
    }
}

/// Replaces this process by the `replica-launch` in the folder of this program.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let program = sibling("replica-launch").map_err(anyhow::Error::msg)?;
    let recording = args.recording.canonicalize().with_context(|| args.recording.display().to_string())?;
    let mut command = Command::new(&program);
    command
        .arg(&args.launch)
        .args(["--source", "replay"])
        .arg("--set")
        .arg(format!("replay.recording={}", recording.display()))
        .arg("--set")
        .arg(format!("replay.speed={:?}", args.speed.0));
    if !args.topics.is_empty() {
        command.arg("--set").arg(format!("replay.topics={:?}", args.topics));
    }
    for text in &args.overrides {
        command.arg("--set").arg(text);
    }
    for (is_given, flag) in [(args.resume, "--resume"), (args.overwrite, "--overwrite"), (args.check, "--check")] {
        command.args(is_given.then_some(flag));
    }
    Err(command.exec()).with_context(|| format!("cannot start {}", program.display()))
}
