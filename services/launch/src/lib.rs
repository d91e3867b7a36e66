//! The supervisor: checks a launch.toml and everything that it names, starts its stages as processes, observes them, and
//! writes a summary.
//!
//! It must never touch a point or link a stage or the simulator: it gets all information about a stage from
//! `--describe` and `--check`, and about the table `[simulate]` from `replica simulate --describe`. It decides nothing
//! by the name of a stage.
//!
//! | module | content |
//! |---|---|
//! | `check` | launch file to `plan`: tables (`manifest`), programs, dataflow |
//! | `remap` | names of topics in the run, for several stages of one program |
//! | `identity` | programs, models and other files on which results depend |
//! | `supervise` | the life of a run: attempts, processes, restarts |
//! | `decision` | pure decisions: whether a stage fails, hangs or stalls, and the reaction |
//! | `swap` | replacing a stage of a running pipeline |
//! | `log` | events on stderr, as text or as JSON |
//!
//! Start with [`main`], a table of contents: arguments, plan, run. `check::plan` turns the launch file into a plan with
//! all problems at once; `supervise` carries it out; `decision` contains the reactions to faults, as pure functions of
//! the observations.

mod active_run;
mod check;
mod control;
mod costs;
mod decision;
mod identity;
mod limits;
mod log;
mod manifest;
mod metrics;
mod plan;
mod programs;
mod progress;
mod recorder;
mod remap;
mod resources;
mod run_folder;
mod shell_files;
mod slowest;
mod stage_figures;
mod stage_process;
mod supervise;
mod swap;
mod swap_record;

use check::Refusal;
use clap::{CommandFactory, Parser};
use log::LogFormat;
use plan::{Plan, Selection};
use run::{Change, exit};
use run_folder::EarlierResults;
use shell_files::ShellFiles;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use supervise::{Options, Start};

/// Runs the stages of a launch file, each as its own process.
#[derive(Parser)]
#[command(
    name = "replica-launch",
    version = env!("REPLICA_VERSION"),
    after_help = "Exit codes: 0 done, 1 failed, 2 usage, 3 done but doubtful or incomplete, 78 invalid configuration\n\n\
        Example:\n  replica-launch launch.toml --set run.drive=drives/monday --set run.output=out/monday"
)]
#[allow(clippy::struct_excessive_bools, reason = "each flag of a command line is independent of the others")]
struct Arguments {
    /// The launch file
    #[arg(default_value = "launch.toml")]
    launch_file: PathBuf,
    /// Replace a setting, e.g. --set run.drive=drives/monday (may be repeated)
    #[arg(long, value_name = "TABLE.KEY=VALUE", value_parser = Change::set)]
    set: Vec<Change>,
    /// Leave out a key of the launch file, so that its default applies, e.g. --unset infer.model (may be repeated); --set may
    /// set it again
    #[arg(long, value_name = "TABLE.KEY", value_parser = Change::unset)]
    unset: Vec<Change>,
    /// The table of the run's source, e.g. replay. It replaces the stages that produce its topics. Stages that then lack an
    /// input, or whose topics no stage reads any more, are left out
    #[arg(long, value_name = "TABLE")]
    source: Option<String>,
    /// Leave a stage out (may be repeated)
    #[arg(long, value_name = "TABLE")]
    without: Vec<String>,
    /// Record topics of the run into this MCAP file; needs --topics
    #[arg(long, value_name = "MCAP", requires = "topics")]
    record: Option<PathBuf>,
    /// Topics to record, e.g. submap,color
    #[arg(long, value_delimiter = ',', requires = "record")]
    topics: Vec<String>,
    /// Continue a killed or failed run into the same output from its last barrier
    #[arg(long)]
    resume: bool,
    /// Replace the results of an earlier run in the output; without it, they are kept and the run is refused
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Report all problems of the launch file and of everything that it names, and start nothing
    ///
    /// With --resume, also report whether the run in the output has other settings, programs or files.
    #[arg(long)]
    check: bool,
    /// Print the stages and topics as a Mermaid diagram, and start nothing
    #[arg(long)]
    graph: bool,
    /// Write the run's figures into this file about once a second, in Prometheus' text format
    #[arg(long, value_name = "FILE")]
    metrics: Option<PathBuf>,
    /// End at once, as if killed, when this parent process ends
    #[arg(long, value_name = "PID")]
    end_with: Option<u32>,
    /// Wait up to this long for another run that writes into the output, also on another host
    #[arg(long, value_name = "SECONDS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=31_536_000))]
    wait: u32,
    /// Format of the messages on stderr and of the stages' logs
    #[arg(long, value_enum, default_value_t = LogFormat::Text)]
    log: LogFormat,
    #[command(flatten)]
    shell_files: ShellFiles,
}

impl Arguments {
    /// The changes of the launch file, in the order in which they apply.
    fn changes(&self) -> Vec<Change> {
        [&self.unset[..], &self.set].concat()
    }
}

/// The whole program.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    arguments.log.install();
    if let Some(code) = arguments.shell_files.write(Arguments::command()) {
        return code;
    }
    if let Some(parent) = arguments.end_with
        && let Err(error) = run::process::end_with(parent)
    {
        tracing::error!("replica-launch: --end-with {parent}: {error}, or it did not start this program");
        return ExitCode::from(exit::FAILED);
    }
    let changes = arguments.changes();
    let wait = Duration::from_secs(u64::from(arguments.wait));
    let selection = Selection { source: arguments.source, without: arguments.without, recorded: arguments.topics };
    let plan = match check::plan(&arguments.launch_file, &changes, &selection) {
        Ok(plan) => plan,
        Err(refusal) => return ExitCode::from(report_refusal(&arguments.launch_file, &refusal)),
    };
    if arguments.graph {
        return print(&check::dataflow::mermaid(&plan.stages));
    }
    if arguments.check {
        let printed = print(&checked(&arguments.launch_file, &plan));
        return if arguments.resume { ExitCode::from(supervise::check_resume(plan, wait)) } else { printed };
    }
    let Arguments { resume, overwrite, log, metrics, record, .. } = arguments;
    let start = match (resume, overwrite) {
        (true, _) => Start::Resume,
        (false, true) => Start::Overwrite,
        (false, false) => Start::New,
    };
    ExitCode::from(supervise::run(plan, Options { start, log, metrics, record, wait }))
}

/// Reports why the launch file is not used. Returns the exit code.
fn report_refusal(launch_file: &Path, refusal: &Refusal) -> u8 {
    let Refusal { problems, is_failure } = refusal;
    for problem in problems {
        tracing::error!(kind = "problem", "{problem}");
    }
    let plural = if problems.len() == 1 { "" } else { "s" };
    let advice = if *is_failure { "; a program failed during the check, so try again" } else { "" };
    tracing::error!("{}: {} problem{plural}{advice}", launch_file.display(), problems.len());
    if *is_failure { exit::FAILED } else { exit::CONFIGURATION }
}

/// The answer to `--check` without problems: a preview of a start.
fn checked(launch_file: &Path, plan: &Plan) -> String {
    let mut lines = vec![format!("{}: {} stages, no problems", launch_file.display(), plan.stages.len())];
    if plan.simulate.is_some() {
        lines.push(format!(
            "{} does not exist: a start simulates it as set in [simulate]",
            plan.context.drive.display()
        ));
    }
    if let Some(results) = EarlierResults::find(&plan.context.output) {
        lines.push(format!("{}: holds the results of {results}", plan.context.output.display()));
    }
    lines.join("\n") + "\n"
}

/// Prints an answer. A closed standard output is not an error.
fn print(text: &str) -> ExitCode {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            tracing::error!("standard output: {error}");
            ExitCode::from(exit::FAILED)
        }
        _ => ExitCode::from(exit::DONE),
    }
}
