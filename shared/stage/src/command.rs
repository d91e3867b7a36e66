//! The commands of a stage's program.

use crate::command_line::{self, Action, CommandLine, NO_REQUEST, RunArguments, print_json, usage};
use crate::own_table::own_table;
use crate::program::{Program, ProgramOf};
use crate::runner::Ending;
use crate::table::{check_table, describe_table, description};
use crate::{Problem, Stage, exit, log};
use files::regular_file;
use run::assignment::Assignment;
use run::launch_file::LaunchFile;
use run::{CheckRequest, DescribeRequest};
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The `main` of a stage's program.
///
/// - `--describe [REQUEST]` prints inputs, outputs and settings as JSON, as the launch file of the request
///   ([`DescribeRequest`]) sets them,
/// - `--check REQUEST` prints the problems of a launch file's table as JSON ([`CheckRequest`]),
/// - `run ASSIGNMENT` runs the stage with the supervisor's file ([`Assignment`]),
/// - `run --recording FILE …` runs it alone, on a recording of its inputs, with the feature `alone`,
/// - `run --linked AGENT` runs it as part of a run on another host ([`crate::remote`]).
pub fn run<S: Stage>() -> ExitCode {
    let program = || run_program(&ProgramOf::<S>::new(), std::env::args_os());
    ExitCode::from(run::process::with_enough_stack(program))
}

/// [`run()`] for a stage that is known at run time. `arguments` start with the program's name. Returns the exit code.
pub fn run_program(program: &dyn Program, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    match command_line::parse(program, arguments.into_iter().collect()) {
        Ok(CommandLine { describe: Some(request), .. }) if request == NO_REQUEST => print_json(&description(program)),
        Ok(CommandLine { describe: Some(request), .. }) => match serde_json::from_str(&request) {
            Ok(request) => describe(program, &request),
            Err(error) => usage(program, &format!("--describe {request}: {error}")),
        },
        Ok(CommandLine { check: Some(request), .. }) => match serde_json::from_str(&request) {
            Ok(request) => print_json(&check(program, &request)),
            Err(error) => usage(program, &format!("--check {request}: {error}")),
        },
        Ok(CommandLine { action: Some(Action::Run(arguments)), .. }) => match arguments {
            RunArguments { assignment: Some(assignment), .. } => run_assignment(program, &assignment),
            RunArguments { linked: Some(agent), .. } => crate::remote::serve(program, agent),
            #[cfg(feature = "alone")]
            RunArguments { alone, .. } => crate::alone::run(program, &alone),
            #[cfg(not(feature = "alone"))]
            _ => usage(
                program,
                "run needs the ASSIGNMENT of a supervisor: built without the feature `alone` of the crate stage",
            ),
        },
        Ok(CommandLine { action: None, .. }) => usage(program, "--describe, --check or run is missing"),
        Err(code) => code,
    }
}

/// Ignores problems of the launch file: `--check` reports them, and the defaults apply here.
fn describe(program: &dyn Program, request: &DescribeRequest) -> u8 {
    let file = LaunchFile::load(&request.launch_file, &request.changes).ok();
    let folder = request.launch_file.parent().unwrap_or(Path::new("/"));
    match describe_table(program, file.as_ref(), &request.table, folder) {
        Ok(description) => print_json(&description),
        Err(error) => {
            eprintln!("{error}");
            exit::CONFIGURATION
        }
    }
}

fn check(program: &dyn Program, request: &CheckRequest) -> Vec<Problem> {
    match LaunchFile::load(&request.launch_file, &request.changes) {
        Ok(file) => check_table(program, &file, &request.table, &request.context),
        Err(problems) => problems,
    }
}

/// The signal by which a supervisor stops its stages.
const STOP_SIGNAL: i32 = run::process::STOP_STAGE.as_raw();

fn run_assignment(program: &dyn Program, path: &Path) -> u8 {
    log::start();
    let assignment = regular_file::read(path)
        .map_err(|error| error.to_string())
        .and_then(|bytes| serde_json::from_slice::<Assignment>(&bytes).map_err(|error| error.to_string()));
    let assignment = match assignment {
        Ok(assignment) => assignment,
        Err(error) => {
            tracing::error!("assignment {}: {error}", path.display());
            return exit::CONFIGURATION;
        }
    };
    let launch_file = match LaunchFile::load(&assignment.launch_file, &assignment.changes) {
        Ok(launch_file) => launch_file,
        Err(problems) => {
            for problem in problems {
                tracing::error!("{}: {}", problem.key, problem.text);
            }
            return exit::CONFIGURATION;
        }
    };
    let (stage, problems) = match own_table(&launch_file, &assignment.stage) {
        Ok(table) => program.configured(&table),
        Err(problem) => {
            tracing::error!("{}", launch_file.render(&problem));
            return exit::CONFIGURATION;
        }
    };
    if !problems.is_empty() {
        for problem in &problems {
            tracing::error!("{}", launch_file.render(problem));
        }
        return exit::CONFIGURATION;
    }
    let _run = tracing::info_span!("run", domain = %assignment.domain).entered();
    let epoch = assignment.restart.as_ref().map_or(0, |restart| restart.epoch);
    let _span = tracing::info_span!("stage", stage = %assignment.stage, epoch).entered();
    let stop = Arc::new(AtomicBool::new(false));
    // Schedulers send SIGTERM to all processes of a job. The supervisor drains the run, for which it needs its stages: they
    // ignore SIGTERM, end with their supervisor, and stop when it sends the other signal.
    let ignored = signal_hook::flag::register(signal_hook::consts::SIGTERM, Arc::new(AtomicBool::new(false)));
    let stopped = signal_hook::flag::register(STOP_SIGNAL, Arc::clone(&stop));
    if let Err(error) = ignored.and(stopped) {
        tracing::error!("signals cannot be received: {error}");
        return exit::FAILED;
    }
    match crate::runner::run(program, &*stage, &assignment, stop) {
        Ok(Ending::Done) => exit::DONE,
        Ok(Ending::Stopped) => {
            tracing::info!("stopped on request");
            exit::INCOMPLETE
        }
        Err(error) => {
            tracing::error!("{error}");
            error.exit_code()
        }
    }
}
