//! State of a run according to the operating system.

use crate::wait_for;
use rustix::process::Pid;
use std::path::Path;

/// Living children of a process.
pub fn processes_of(parent: u32) -> Vec<Pid> {
    let entries = std::fs::read_dir("/proc").expect("Linux").flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_string_lossy().parse::<i32>().ok());
    numbers
        .filter(|pid| {
            let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
            let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
            fields.len() > 1 && fields[0] != "Z" && fields[1] == parent.to_string()
        })
        .filter_map(Pid::from_raw)
        .collect()
}

/// Whether the process still runs (a zombie does not).
pub fn is_alive(pid: Pid) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", pid.as_raw_nonzero())).unwrap_or_default();
    stat.rsplit(')').next().and_then(|rest| rest.split_whitespace().next()).is_some_and(|state| state != "Z")
}

/// Files of all runs in shared memory and in /tmp that name `domain` (empty: any).
pub fn leftovers(domain: &str) -> Vec<String> {
    let start = format!("replica_{domain}");
    let mut found = Vec::new();
    for folder in ["/dev/shm", "/tmp"] {
        let entries = std::fs::read_dir(folder).expect("Linux").flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        found.extend(names.filter(|name| name.starts_with(&start)).map(|name| format!("{folder}/{name}")));
    }
    found.sort();
    found
}

/// The domain of a run, from the assignments of its stages.
pub fn domain_of(output: &Path) -> String {
    wait_for("an assignment", || find_domain(output))
}

/// The domain of a run, if a stage already has an assignment.
pub(crate) fn find_domain(output: &Path) -> Option<String> {
    let files = std::fs::read_dir(output.join("run")).ok()?.flatten();
    let assignments = files.filter_map(|file| serde_json::from_slice(&std::fs::read(file.path()).ok()?).ok());
    assignments.into_iter().find_map(|assignment: serde_json::Value| Some(assignment["domain"].as_str()?.to_owned()))
}
