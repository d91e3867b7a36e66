//! The supervisor: checks a launch.toml and everything that it names, starts its stages as processes, watches them, and
//! sums up. It knows stages only by what they say of themselves (`--describe`), and never touches a point.

mod check;
mod child;
mod control;
mod costs;
mod events;
mod exhausted;
mod fit;
mod graph;
mod manifest;
mod metrics;
mod plan;
mod programs;
mod recorder;
mod run_folder;
mod screen;
mod sourced;
mod supervise;
mod swap;
mod swap_record;
mod watch;

use clap::Parser;
use events::{Log, json_line};
use plan::Selection;
use stage::exit;
use std::path::PathBuf;
use std::process::ExitCode;
use supervise::Asides;

/// Runs the stages of a launch file, each as its own process.
#[derive(Parser)]
#[command(
    name = "replica-launch",
    version,
    after_help = "Exit codes: 0 done, 1 failed, 2 usage, 3 done but not complete, 78 bad configuration"
)]
struct Arguments {
    /// The launch file
    #[arg(default_value = "launch.toml")]
    launch_file: PathBuf,
    /// Replace a setting, e.g. --set run.drive=drives/monday (may be repeated)
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
    /// The table of the run's source, e.g. replay: stages are left out that produce what it produces, that then lack an
    /// input, or whose results then nobody reads
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
    /// Go on from the last barrier of a run into the same output that was killed or given up
    #[arg(long)]
    resume: bool,
    /// Report every fault of the launch file and of what it names, and start nothing
    #[arg(long)]
    check: bool,
    /// Print the stages and topics as a Mermaid diagram, and start nothing
    #[arg(long)]
    graph: bool,
    /// Write the run's figures into this file about once a second, in Prometheus' text format
    #[arg(long, value_name = "FILE")]
    metrics: Option<PathBuf>,
    /// How the run speaks on stderr, and its stages in their logs
    #[arg(long, value_enum, default_value_t = Log::Text)]
    log: Log,
}

/// The whole program.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let selection = Selection { source: arguments.source, without: arguments.without, recorded: arguments.topics };
    let plan = match check::plan(&arguments.launch_file, &arguments.overrides, &selection) {
        Ok(plan) => plan,
        Err(faults) => {
            for fault in &faults {
                say(arguments.log, "problem", fault);
            }
            let (file, plural) = (arguments.launch_file.display(), if faults.len() == 1 { "" } else { "s" });
            say(arguments.log, "said", &format!("{file}: {} fault{plural}", faults.len()));
            return ExitCode::from(exit::CONFIGURATION);
        }
    };
    if arguments.graph {
        print!("{}", graph::mermaid(&plan.stages));
    } else if arguments.check {
        println!("{}: {} stages, no faults", arguments.launch_file.display(), plan.stages.len());
    } else {
        let Arguments { resume, log, metrics, record, .. } = arguments;
        return ExitCode::from(supervise::run(plan, resume, Asides { log, metrics, record }));
    }
    ExitCode::from(exit::DONE)
}

/// Before there is a screen.
fn say(log: Log, kind: &str, message: &str) {
    match log {
        Log::Text => eprintln!("{message}"),
        Log::Json => eprint!("{}", json_line(kind, message, serde_json::Value::Null)),
    }
}
