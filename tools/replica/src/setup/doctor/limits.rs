//! Limits that the stages inherit from the shell (`ulimit`). Locked memory is not checked: no process of a run locks memory.

use super::check::{Check, State, at_least};
use run::space::size_text;
use rustix::process::{Resource, getrlimit};

/// Open files that a stage of the sample needs (395), and a stage of a pipeline with twice as many stages. `replica-launch`
/// computes the need of each launch file.
const LEAST_FILES: u64 = 400;
const GOOD_FILES: u64 = 1024;

/// The checks.
pub fn checks() -> [Check; 3] {
    let files = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    let count = if files == u64::MAX { "unlimited".to_owned() } else { files.to_string() };
    let rule = format!("at least {LEAST_FILES}, better {GOOD_FILES}");
    [
        Check::ok("open files", count, rule)
            .or(at_least(&files, &LEAST_FILES, &GOOD_FILES), || format!("ulimit -n {GOOD_FILES}")),
        unlimited("address space", Resource::As, "ulimit -v unlimited; limit memory with a control group instead"),
        unlimited("file size", Resource::Fsize, "ulimit -f unlimited"),
    ]
}

/// Check of a limit that would break large runs.
fn unlimited(subject: &'static str, resource: Resource, advice: &str) -> Check {
    let limit = getrlimit(resource).current;
    let state = if limit.is_none() { State::Ok } else { State::Warning };
    Check::ok(subject, limit.map_or("unlimited".to_owned(), size_text), "must be unlimited")
        .or(state, || advice.to_owned())
}
