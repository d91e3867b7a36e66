//! `replica replay`: a launch file with a recording in the place of the stages that it was recorded from.

use anyhow::Context;
use stage::process::sibling;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::str::FromStr;

/// Runs a launch file on a recording: stages whose topics are recorded, and stages that then lack an input or work for
/// nobody, are left out.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The recording.
    recording: PathBuf,
    /// The launch file.
    #[arg(long, default_value = "launch.toml")]
    launch: PathBuf,
    /// Topics to publish [default: all that are recorded].
    #[arg(long, value_delimiter = ',')]
    topics: Vec<String>,
    /// Times the original pace, or max: as fast as the stages take it.
    #[arg(long, default_value = "max")]
    speed: Speed,
    /// Replace a setting, e.g. --set run.output=out/replayed (may be repeated).
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
    /// Go on from the last barrier of a replay into the same output that was killed.
    #[arg(long)]
    resume: bool,
    /// Report every fault, and start nothing.
    #[arg(long)]
    check: bool,
}

/// As the setting `replay.speed` has it: 0 is as fast as can be.
#[derive(Clone, Copy, Debug)]
struct Speed(f64);

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self(0.0));
        }
        let factor = text.parse().ok().filter(|factor: &f64| *factor > 0.0 && *factor <= 1000.0);
        factor.map(Self).ok_or_else(|| "must be a factor above 0, up to 1000, or max".to_owned())
    }
}

/// Becomes the `replica-launch` beside this program.
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
    command.args(args.resume.then_some("--resume")).args(args.check.then_some("--check"));
    Err(command.exec()).with_context(|| format!("{} cannot be started", program.display()))
}
