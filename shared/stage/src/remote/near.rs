//! The proxy program of a stage on another host: answers the supervisor, and runs the stage as the program there
//! requests.

use super::connection::{Connect, Far, port, remote_of};
use super::stand_in::RemoteProgram;
use super::wire::{Answer, LaunchText, Request};
use crate::command_line::print_json;
use crate::{Problem, StepError, exit, run_program};
use files::regular_file;
use run::assignment::{Assignment, Description};
use run::{CheckRequest, DescribeRequest, FileIdentity};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// The program `replica-remote`: answers `--describe REQUEST`, `--check REQUEST` and `run ASSIGNMENT` with the program
/// on the other host. `arguments` start with the program's name. Returns the exit code.
pub fn run(arguments: Vec<OsString>, connect: Connect) -> u8 {
    let texts: Vec<&str> = arguments.iter().filter_map(|argument| argument.to_str()).collect();
    let answered = match texts[..] {
        [_, "--describe", request] => {
            parse(request.as_bytes()).and_then(|request| describe(&request, connect)).map(|d| print_json(&d))
        }
        [_, "--check", request] => {
            parse(request.as_bytes()).and_then(|request| check(&request, connect)).map(|p| print_json(&p))
        }
        [_, "run", assignment] => {
            return match read_assignment(Path::new(assignment))
                .and_then(|a| RemoteProgram::from_assignment(&a, connect))
            {
                Ok(program) => run_program(&program, arguments),
                Err(error) => refuse(&error),
            };
        }
        _ => {
            eprintln!(
                "replica-remote stands for a stage with the key `host`; the supervisor, replica-launch, starts it"
            );
            return exit::USAGE;
        }
    };
    answered.unwrap_or_else(|error| refuse(&error))
}

fn refuse(error: &StepError) -> u8 {
    eprintln!("{error}");
    exit::CONFIGURATION
}

fn parse<'a, T: serde::Deserialize<'a>>(text: &'a [u8]) -> Result<T, StepError> {
    serde_json::from_slice(text).map_err(StepError::configuration)
}

fn read_assignment(path: &Path) -> Result<Assignment, StepError> {
    let bytes = regular_file::read(path).map_err(|error| StepError::io(error).at(path.display()))?;
    parse(&bytes).map_err(|error| error.at(path.display()))
}

fn describe(request: &DescribeRequest, connect: Connect) -> Result<Description, StepError> {
    let remote = remote_of(request.remote.as_ref())?;
    let launch = LaunchText::read(&request.launch_file, &request.changes, &request.table)?;
    let mut far = Far::new(remote, connect(remote, &request.table, None)?);
    check_description(far.describe(&launch)?, &remote.host)
}

/// Refuses sources and sinks, whose files are on the host of the run, and third-party topics, which have no type here.
fn check_description(description: Description, host: &str) -> Result<Description, StepError> {
    let name = &description.name;
    if description.inputs.is_empty() || description.outputs.is_empty() {
        let text = format!(
            "{name} has no input or no output, so it reads or writes files of this host; it cannot run on {host}"
        );
        return Err(StepError::configuration(text));
    }
    let topics = description.inputs.iter().chain(&description.outputs).map(|port| &port.topic);
    for topic in topics {
        port(topic)?;
    }
    Ok(description)
}

fn check(request: &CheckRequest, connect: Connect) -> Result<Vec<Problem>, StepError> {
    let remote = remote_of(request.remote.as_ref())?;
    let launch = LaunchText::read(&request.launch_file, &request.changes, &request.table)?;
    let mut far = Far::new(remote, connect(remote, &request.table, None)?);
    let description = far.describe(&launch)?;
    let mut problems = match far.ask(&Request::Check(launch, request.context.clone()), [])? {
        Answer::Problems(problems) => problems,
        other => return Err(far.unexpected(&other)),
    };
    for problem in &mut problems {
        problem.text = format!("on {}: {}", remote.host, problem.text);
    }
    let folder = &request.context.launch_folder;
    problems.extend(
        different_file(&description.files, folder, &remote.host).map(|text| Problem::for_key(&request.table, text)),
    );
    Ok(problems)
}

/// A file that has another content at the same path here: it is unclear which file the launch file means.
fn different_file(files: &BTreeMap<String, String>, folder: &Path, host: &str) -> Option<String> {
    files.iter().find_map(|(file, digest)| {
        let here = folder.join(file);
        // The programs of the two hosts may be built differently.
        let may_compare = Path::new(file).is_relative() && here.is_file() && !is_program(&here);
        let identity = may_compare.then(|| FileIdentity::read(&here, None).ok()).flatten()?;
        (identity.digest() != digest)
            .then(|| format!("{file} on {host} differs from {}; copy one of them", here.display()))
    })
}

fn is_program(file: &Path) -> bool {
    file.metadata().is_ok_and(|metadata| metadata.permissions().mode() & 0o111 != 0)
}
