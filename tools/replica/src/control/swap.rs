//! `replica swap`: replaces a stage of a running pipeline by another program or other settings.

use super::attach::RunArgument;
use anyhow::{Context, bail};
use command_line::say;
use run::Change;
use run::control::{Answer, Request, SwapRequest};
use std::path::PathBuf;
use std::process::ExitCode;

/// Replace a stage of a running pipeline.
///
/// The supervisor drains the pipeline to a barrier, replaces the stage and continues. No message is lost or duplicated. A
/// replacement that does not fit is refused with the reasons, and the run continues unchanged. Without any change the stage's
/// program is restarted.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 swapped, 1 refused, undone or failed, 2 wrong usage\n\n\
                  Example: replica swap infer --set unknown_below=0.5")]
pub struct Args {
    /// Name of the stage: its table in launch.toml
    stage: String,
    /// New program; a relative path starts at the current folder
    #[arg(long)]
    program: Option<PathBuf>,
    /// New value of a setting, as in launch.toml (may be repeated)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Remove a setting, so that its default applies (may be repeated)
    #[arg(long, value_name = "KEY")]
    unset: Vec<String>,
    /// Go back to the program and settings that the run started with; other options then change these
    #[arg(long)]
    back: bool,
    #[command(flatten)]
    run: RunArgument,
}

/// Runs the command. The result goes to stdout, the progress to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let request = SwapRequest { stage: args.stage.clone(), back: args.back, changes: changes(args)? };
    let request = Request::Swap(request);
    match args.run.find_alive()?.ask(&request)? {
        Answer::Swapped(swapped) if swapped.undone.is_none() => {
            say!("{swapped}")?;
            Ok(ExitCode::SUCCESS)
        }
        Answer::Swapped(swapped) => bail!("{swapped}"),
        Answer::Refused(reasons) => bail!("swap refused, nothing was changed:\n{}", reasons.join("\n")),
        Answer::Ended(outcome) => bail!("the run ended ({outcome}) before the swap"),
        Answer::Working(_) => bail!("the supervisor closed the connection without an answer"),
    }
}

/// What the options change in the table of the stage.
fn changes(args: &Args) -> anyhow::Result<Vec<Change>> {
    let table = || args.stage.clone();
    let unset = args.unset.iter().map(|key| Change::Unset { table: table(), key: key.clone() });
    let mut changes: Vec<Change> = unset.collect();
    if let Some(program) = &args.program {
        let value = std::path::absolute(program)?.display().to_string();
        changes.push(Change::Set { table: table(), key: "program".to_owned(), value });
    }
    for text in &args.set {
        let (key, value) =
            text.split_once('=').with_context(|| format!("--set {text}: must have the form KEY=VALUE"))?;
        let key = key.trim().to_owned();
        let value = value.trim().to_owned();
        changes.push(Change::Set { table: table(), key, value });
    }
    Ok(changes)
}
