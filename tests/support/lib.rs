//! What the process tests share: launch files in a folder of their own, running supervisors, and waiting for conditions.

use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Far more than anything here takes on a busy machine; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_mins(3);

/// A binary of the workspace. `cargo test --workspace` has built it beside the tests.
pub fn binary(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("a test has a path");
    let folder = tests.parent().and_then(Path::parent).expect("tests lie in target/<profile>/deps");
    let path = folder.join(name);
    assert!(path.is_file(), "{} is not there: run `cargo test --workspace`", path.display());
    path
}

/// Waits until `condition` gives something.
pub fn wait_for<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(value) = condition() {
            return value;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

/// A folder with a launch.toml in it.
pub struct Launch {
    folder: tempfile::TempDir,
    arguments: Vec<String>,
}

impl Launch {
    /// With this launch.toml.
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("launch.toml"), text).expect("written");
        Self { folder, arguments: Vec::new() }
    }
    /// The small pipeline of tests/misbehaving, the relay's table being `relay`.
    pub fn of_misbehaving(run: &str, source: &str, relay: &str) -> Self {
        let mut text =
            format!("[run]\ndrive = \".\"\noutput = \"out\"\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{run}\n");
        for (table, keys) in [("source", source), ("relay", relay), ("sink", "")] {
            let program = binary(&format!("misbehaving-{table}"));
            writeln!(text, "[{table}]\nprogram = '{}'\n{keys}", program.display()).expect("a string takes everything");
        }
        Self::new(&text)
    }
    /// Adds an argument of the command line.
    #[must_use]
    pub fn with(mut self, argument: &str) -> Self {
        self.arguments.push(argument.to_owned());
        self
    }
    /// The folder of launch.toml.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
    /// `out` beside launch.toml.
    pub fn output(&self) -> PathBuf {
        self.folder().join("out")
    }
    fn command(&self) -> Command {
        let mut command = Command::new(binary("replica-launch"));
        command.arg(self.folder().join("launch.toml")).args(&self.arguments).stdin(Stdio::null());
        command
    }
    /// Runs to the end.
    pub fn run(&self) -> Output {
        self.command().output().expect("replica-launch starts")
    }
    /// As [`Launch::run`] with an environment variable.
    pub fn run_with_env(&self, key: &str, value: &str) -> Output {
        self.command().env(key, value).output().expect("replica-launch starts")
    }
    /// Starts and returns.
    pub fn start(&self) -> Running {
        self.start_again(&[])
    }
    /// As [`Launch::start`] with further arguments.
    pub fn start_again(&self, arguments: &[&str]) -> Running {
        let errors = std::fs::File::create(self.folder().join("stderr.txt")).expect("created");
        let mut command = self.command();
        let child =
            command.args(arguments).stdout(Stdio::null()).stderr(errors).spawn().expect("replica-launch starts");
        Running { child, folder: self.folder().to_owned() }
    }
    /// As [`Launch::start`], with nobody reading what it says.
    pub fn start_with_closed_stderr(&self) -> Running {
        let mut child =
            self.command().stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("replica-launch starts");
        drop(child.stderr.take());
        Running { child, folder: self.folder().to_owned() }
    }
    /// A file of the output.
    pub fn read(&self, name: &str) -> Vec<u8> {
        let path = self.output().join(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }
    /// `summary.json`.
    pub fn summary(&self) -> serde_json::Value {
        serde_json::from_slice(&self.read("summary.json")).expect("JSON")
    }
    /// A stage's part of `summary.json`.
    pub fn stage_summary(&self, stage: &str) -> serde_json::Value {
        let summary = self.summary();
        let stages = summary["stages"].as_array().expect("a list").clone();
        stages.into_iter().find(|entry| entry["name"] == stage).expect("the stage is summed up")
    }
}

/// All files of a result folder except what a run keeps about itself (times differ), by name.
pub fn result_files(output: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in [output.to_owned(), output.join("clouds")] {
        for entry in std::fs::read_dir(&folder).expect("readable").flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.path().is_file() && name != "summary.json" {
                files.insert(name, std::fs::read(entry.path()).expect("readable"));
            }
        }
    }
    files
}

/// What a run said, for assertion messages.
pub fn said(output: &Output) -> String {
    format!("{}\n{}", output.status, String::from_utf8_lossy(&output.stderr))
}

/// A supervisor at work. Killed when dropped.
pub struct Running {
    child: Child,
    folder: PathBuf,
}

impl Running {
    /// The supervisor's process.
    pub fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }
    /// The process of a stage, as soon as there is one.
    pub fn stage(&self, stage: &str) -> Pid {
        wait_for(&format!("a process of stage {stage}"), || self.find_stage(stage))
    }
    /// The process of a stage if it lives: the child of the supervisor that was given the stage's assignment.
    pub fn find_stage(&self, stage: &str) -> Option<Pid> {
        let assignment = format!("/run/{stage}.json");
        processes_of(self.child.id()).into_iter().find(|pid| {
            let line = std::fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
            String::from_utf8_lossy(&line).trim_end_matches('\0').ends_with(&assignment)
        })
    }
    /// Sends a signal to the supervisor.
    pub fn signal(&self, signal: Signal) {
        kill_process(self.pid(), signal).expect("the supervisor lives");
    }
    /// Waits for the end; the exit code, `None` if a signal ended it.
    pub fn wait(mut self) -> Option<i32> {
        let status = wait_for("the end of the run", || self.child.try_wait().expect("waits"));
        status.code()
    }
    /// What it has said so far.
    pub fn stderr(&self) -> String {
        std::fs::read_to_string(self.folder.join("stderr.txt")).unwrap_or_default()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Stages die with their supervisor; one that has ended already needs no killing.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

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

/// The domain of a run, from what its stages were told.
pub fn domain_of(output: &Path) -> String {
    let path = output.join("run/relay.json");
    let assignment =
        wait_for("an assignment", || serde_json::from_slice::<serde_json::Value>(&std::fs::read(&path).ok()?).ok());
    assignment["domain"].as_str().expect("a name").to_owned()
}
