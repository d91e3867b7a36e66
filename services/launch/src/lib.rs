//! The supervisor: checks a launch.toml and everything that it names, starts its stages as processes, watches them, and
//! sums up. It knows stages only by what they say of themselves (`--describe`), and never touches a point.

mod check;
mod child;
mod graph;
mod manifest;
mod plan;
mod programs;
mod run_folder;
mod screen;
mod summary;
mod supervise;
mod watch;

use clap::Parser;
use stage::exit;
use std::path::PathBuf;
use std::process::ExitCode;

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
    /// Go on from the last barrier of a run into the same output that was killed
    #[arg(long)]
    resume: bool,
    /// Report every fault of the launch file and of what it names, and start nothing
    #[arg(long)]
    check: bool,
    /// Print the stages and topics as a Mermaid diagram, and start nothing
    #[arg(long)]
    graph: bool,
}

/// The whole program.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let plan = match check::plan(&arguments.launch_file, &arguments.overrides) {
        Ok(plan) => plan,
        Err(faults) => {
            for fault in &faults {
                eprintln!("{fault}");
            }
            eprintln!(
                "{}: {} fault{}",
                arguments.launch_file.display(),
                faults.len(),
                if faults.len() == 1 { "" } else { "s" }
            );
            return ExitCode::from(exit::CONFIGURATION);
        }
    };
    if arguments.graph {
        print!("{}", graph::mermaid(&plan.stages));
    } else if arguments.check {
        println!("{}: {} stages, no faults", arguments.launch_file.display(), plan.stages.len());
    } else {
        return ExitCode::from(supervise::run(plan, arguments.resume));
    }
    ExitCode::from(exit::DONE)
}
