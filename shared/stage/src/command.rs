//! The command line that every stage's binary has.

use crate::assignment::{Assignment, Description};
use crate::launch_file::LaunchFile;
use crate::runner::Ending;
use crate::{Context, Problem, Settings, Stage, parse_table};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use toml::de::DeTable;

/// Keys of a stage's table that are the supervisor's and not the stage's.
pub const SUPERVISOR_KEYS: [&str; 3] = ["program", "stall_s", "threads"];

/// Environment variable that says how a stage logs: `json` writes a JSON object per line, anything else lines for people.
pub const LOG_FORMAT: &str = "REPLICA_LOG_FORMAT";

/// Exit codes of all programs of the project.
pub mod exit {
    /// Everything went well.
    pub const DONE: u8 = 0;
    /// Failed while running; a restart may help.
    pub const FAILED: u8 = 1;
    /// The command line makes no sense.
    pub const USAGE: u8 = 2;
    /// Through, but not complete: data was lost or left out, or a threshold missed.
    pub const INCOMPLETE: u8 = 3;
    /// The configuration is wrong; a restart cannot help.
    pub const CONFIGURATION: u8 = 78;
}

/// Question of `--describe`, answered with a [`Description`]: what a stage writes may depend on its settings
/// ([`Stage::outputs_with`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DescribeRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// `--set` of the command line.
    pub overrides: Vec<String>,
    /// The stage's table.
    pub table: String,
}

/// Question of `--check`, answered with a list of [`Problem`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRequest {
    /// The launch file.
    pub launch_file: PathBuf,
    /// `--set` of the command line.
    pub overrides: Vec<String>,
    /// The stage's table.
    pub table: String,
    /// Where the run will happen.
    pub context: Context,
}

/// The `main` of a stage's binary.
///
/// - `--describe [REQUEST]` prints inputs, outputs and settings as JSON, as the launch file of the request
///   ([`DescribeRequest`]) has them,
/// - `--check REQUEST` prints the problems of a launch file's table as JSON ([`CheckRequest`]),
/// - `run ASSIGNMENT` runs the stage as the supervisor's file says ([`Assignment`]),
/// - `run --recording FILE …` runs it alone, on a recording of its inputs.
pub fn run<S: Stage>() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let code = match arguments[..] {
        ["--describe"] => print_json(&Description::of::<S>()),
        ["--describe", request] => match serde_json::from_str(request) {
            Ok(request) => describe::<S>(&request),
            Err(error) => usage::<S>(&format!("--describe {request}: {error}")),
        },
        ["--check", request] => match serde_json::from_str(request) {
            Ok(request) => print_json(&check::<S>(&request)),
            Err(error) => usage::<S>(&format!("--check {request}: {error}")),
        },
        ["run"] => crate::alone::run::<S>(&[]),
        ["run", option, ..] if option.starts_with("--") => crate::alone::run::<S>(&arguments[1..]),
        ["run", assignment] => run_assignment::<S>(Path::new(assignment)),
        ["--help" | "-h"] => {
            println!("{}", help::<S>());
            exit::DONE
        }
        _ => usage::<S>(&format!("unknown arguments: {}", arguments.join(" "))),
    };
    ExitCode::from(code)
}

fn help<S: Stage>() -> String {
    let mut text = format!(
        "Stage {} of REPLICA. It is started by replica-launch.\n\nUsage:\n  --describe         print inputs, outputs and settings as JSON\n  \
         --check REQUEST    print the problems of a launch file's table as JSON\n  run ASSIGNMENT     run as the supervisor's file says\n  \
         {}\n\nSettings in [{}] of launch.toml:\n",
        S::NAME,
        crate::alone::USAGE,
        S::NAME
    );
    for field in S::Settings::fields() {
        // Writing to a string cannot fail.
        let _ =
            writeln!(text, "  {} = {}  ({}) {} {}", field.key, field.default, field.kind, field.meaning, field.rule);
    }
    text
}

pub(crate) fn usage<S: Stage>(error: &str) -> u8 {
    eprintln!("{error}\n\n{}", help::<S>());
    exit::USAGE
}

pub(crate) fn print_json<T: Serialize>(value: &T) -> u8 {
    match serde_json::to_string(value) {
        Ok(text) => {
            println!("{text}");
            exit::DONE
        }
        Err(error) => {
            eprintln!("{error}");
            exit::FAILED
        }
    }
}

/// The stage's own settings of a table: without the supervisor's keys.
pub(crate) fn own_table(launch_file: &LaunchFile, name: &str) -> Result<DeTable<'static>, Problem> {
    let table = launch_file.table(name)?;
    Ok(table.into_iter().filter(|(key, _)| !SUPERVISOR_KEYS.contains(&key.get_ref().as_ref())).collect())
}

/// Faults of the launch file are for `--check` to report: here they leave the defaults.
fn describe<S: Stage>(request: &DescribeRequest) -> u8 {
    let mut description = Description::of::<S>();
    let file = LaunchFile::load(&request.launch_file, &request.overrides).ok();
    if let Some(table) = file.and_then(|file| own_table(&file, &request.table).ok()) {
        let (settings, _) = parse_table::<S::Settings>(&table);
        match S::outputs_with(&settings, request.launch_file.parent().unwrap_or(Path::new("/"))) {
            Ok(ports) => description.outputs = ports.iter().map(crate::Port::describe).collect(),
            Err(error) => {
                eprintln!("{error}");
                return exit::CONFIGURATION;
            }
        }
    }
    print_json(&description)
}

fn check<S: Stage>(request: &CheckRequest) -> Vec<Problem> {
    let launch_file = match LaunchFile::load(&request.launch_file, &request.overrides) {
        Ok(launch_file) => launch_file,
        Err(problems) => return problems,
    };
    let located = |problem| launch_file.located(&request.table, problem);
    let table = match own_table(&launch_file, &request.table) {
        Ok(table) => table,
        Err(problem) => return vec![problem],
    };
    let (settings, mut problems) = parse_table::<S::Settings>(&table);
    // A setting that is wrong by itself would only give rise to further errors.
    if problems.is_empty() {
        for mut problem in S::check(&settings, &request.context) {
            let value = table.iter().find(|(key, _)| key.get_ref() == problem.key.as_str());
            problem.span = value.map(|(_, value)| value.span());
            problems.push(problem);
        }
    }
    problems.into_iter().map(located).collect()
}

/// Says in one last line why the process panics; the backtrace, if `RUST_BACKTRACE` asks for one, comes before it.
fn explain_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let backtrace = std::backtrace::Backtrace::capture();
        if backtrace.status() == std::backtrace::BacktraceStatus::Captured {
            tracing::error!("{backtrace}");
        }
        tracing::error!("{}", panic.to_string().replace('\n', " "));
    }));
}

/// Logs to stderr, as `REPLICA_LOG` and [`LOG_FORMAT`] say, and panics into the log.
pub(crate) fn start_log() {
    // A log on a full disk cannot be written, nor can that be said there: it must not end the stage.
    let log = tracing_subscriber::fmt()
        .log_internal_errors(false)
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_env("REPLICA_LOG")
                .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info")),
        );
    if std::env::var(LOG_FORMAT).is_ok_and(|format| format == "json") {
        log.json().flatten_event(true).init();
    } else {
        log.init();
    }
    explain_panics();
}

fn run_assignment<S: Stage>(path: &Path) -> u8 {
    start_log();
    let assignment = std::fs::read(path)
        .map_err(|error| error.to_string())
        .and_then(|bytes| serde_json::from_slice::<Assignment>(&bytes).map_err(|error| error.to_string()));
    let assignment = match assignment {
        Ok(assignment) => assignment,
        Err(error) => {
            tracing::error!("assignment {}: {error}", path.display());
            return exit::CONFIGURATION;
        }
    };
    let launch_file = match LaunchFile::load(&assignment.launch_file, &assignment.overrides) {
        Ok(launch_file) => launch_file,
        Err(problems) => {
            for problem in problems {
                tracing::error!("{}: {}", problem.key, problem.text);
            }
            return exit::CONFIGURATION;
        }
    };
    let (settings, problems) = match own_table(&launch_file, &assignment.stage) {
        Ok(table) => parse_table::<S::Settings>(&table),
        Err(problem) => (S::Settings::default(), vec![problem]),
    };
    if !problems.is_empty() {
        for problem in &problems {
            tracing::error!("{}", launch_file.render(problem));
        }
        return exit::CONFIGURATION;
    }
    let stop = Arc::new(AtomicBool::new(false));
    if let Err(error) = signal_hook::flag::register(signal_hook::consts::SIGTERM, Arc::clone(&stop)) {
        tracing::error!("SIGTERM: {error}");
        return exit::FAILED;
    }
    match crate::runner::run::<S>(&settings, &assignment, stop) {
        Ok(Ending::Done) => exit::DONE,
        Ok(Ending::Stopped) => {
            tracing::info!("stopped on request");
            exit::INCOMPLETE
        }
        Err(error) => {
            tracing::error!("{error}");
            exit::FAILED
        }
    }
}
