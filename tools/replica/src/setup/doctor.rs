//! `replica doctor`: whether this machine is ready for runs.
//!
//! | module | examines |
//! |---|---|
//! | `machine` | cores, instructions, memory |
//! | `space` | shared memory, leftovers of killed runs, disk |
//! | `limits` | limits of the shell |
//! | `clock` | the clocks of the machine |
//! | `programs` | programs, models, and a launch file |

mod check;
mod clock;
mod limits;
mod machine;
mod programs;
mod space;

use check::{Check, State};
use command_line::answer::Answer;
use command_line::exit_code;
use run::Change;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Check whether this machine is ready for runs.
///
/// Each line has a state, the value found and the rule. A remedy is below each warning or problem. Nothing is changed.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 no findings, 1 problems, 2 wrong usage, 3 warnings\n\n\
                  Example: replica doctor launch.toml")]
pub struct Args {
    /// Also check this launch file, and whether its clouds fit the disk of its output
    #[arg(value_name = "LAUNCH_FILE")]
    launch_file: Option<PathBuf>,
    /// Override a setting of the launch file (may be repeated)
    #[arg(long, value_name = "TABLE.KEY=VALUE", value_parser = Change::set, requires = "launch_file")]
    set: Vec<Change>,
    /// Folder for results whose disk is checked [default: the output of the launch file, or the current folder]
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// All checks.
#[derive(Serialize)]
struct Findings {
    /// The worst state.
    state: State,
    checks: Vec<Check>,
}

/// Prints the checks.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let planned = args.launch_file.as_deref().and_then(|file| programs::PlannedRun::read(file, &args.set));
    let output = args.output.clone().or(planned.as_ref().map(|run| run.output.clone())).unwrap_or(".".into());
    let mut checks = Vec::from(machine::checks());
    checks.extend(space::shared_memory());
    checks.push(space::disk(&output, planned.as_ref()));
    checks.extend(limits::checks());
    checks.extend(clock::checks());
    checks.extend(programs::installed());
    checks.extend(args.launch_file.as_deref().map(|file| programs::launch_file(file, &args.set)));
    let state = checks.iter().map(|check| check.state).max().unwrap_or(State::Ok);
    let findings = Findings { state, checks };
    args.answer.print(&findings, || findings.table())?;
    Ok(match state {
        State::Ok => ExitCode::SUCCESS,
        State::Warning => ExitCode::from(exit_code::INCOMPLETE),
        State::Problem => ExitCode::FAILURE,
    })
}

impl Findings {
    fn table(&self) -> String {
        let mut text = String::new();
        for Check { subject, state, found, rule, advice } in &self.checks {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:<8} {subject:<14} {found}; {rule}", state.word());
            for line in advice.iter().flat_map(|advice| advice.lines()) {
                let _ = writeln!(text, "{:<8} {:<14} > {line}", "", "");
            }
        }
        let n = |state: State| self.checks.iter().filter(|check| check.state == state).count();
        let _ = writeln!(text, "\nproblems: {}, warnings: {}", n(State::Problem), n(State::Warning));
        text
    }
}
