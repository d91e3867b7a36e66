//! Launch files and the results of their runs.

use crate::processes::{find_domain, leftovers};
use crate::{Running, binary, is_alive, wait_for};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder with a launch.toml in it. Dropping it removes the folder and the shared memory left by killed runs, which
/// no later run into this folder could remove.
pub struct Launch {
    folder: tempfile::TempDir,
    arguments: Vec<String>,
}

impl Launch {
    /// A folder with this launch.toml.
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("launch.toml"), text).expect("written");
        Self { folder, arguments: Vec::new() }
    }
    /// The small pipeline of tests/misbehaving, with the table `relay` of the relay.
    pub fn misbehaving(run: &str, source: &str, relay: &str) -> Self {
        let mut text = format!(
            "[run]\ndrive = \".\"\noutput = \"out\"\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{}\n",
            patient(run)
        );
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
    /// Lets the relay of [`gate`] continue, in this attempt and in all later ones.
    pub fn open_gate(&self) {
        std::fs::write(self.folder().join("gate"), []).expect("written");
    }
    /// The folder of launch.toml.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
    /// The folder `out` next to launch.toml.
    pub fn output(&self) -> PathBuf {
        self.folder().join("out")
    }
    /// The newest barrier with a state.
    pub fn newest_barrier(&self) -> Option<u64> {
        self.barriers().max()
    }
    fn barriers(&self) -> impl Iterator<Item = u64> {
        let folders = std::fs::read_dir(self.states()).into_iter().flatten().flatten();
        folders.filter_map(|folder| folder.file_name().to_string_lossy().parse().ok())
    }
    /// Waits until a state of this barrier or a later one exists, even if only of the source.
    pub fn wait_for_barrier(&self, barrier: u64) {
        wait_for(&format!("barrier {barrier}"), || (self.newest_barrier()? >= barrier).then_some(()));
    }
    /// Waits until this stage has saved its state at this barrier or a later one.
    pub fn wait_for_barrier_of(&self, stage: &str, barrier: u64) {
        wait_for(&format!("{stage} at barrier {barrier}"), || {
            let is_saved = |barrier: &u64| self.states().join(format!("{barrier}/{stage}.state")).is_file();
            self.barriers().filter(is_saved).any(|saved| saved >= barrier).then_some(())
        });
    }
    /// Folder of the saved states.
    pub fn states(&self) -> PathBuf {
        self.output().join("run/states")
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
    /// [`Launch::run`] with an environment variable.
    pub fn run_with_env(&self, key: &str, value: &str) -> Output {
        self.command().env(key, value).output().expect("replica-launch starts")
    }
    /// Starts the run and returns.
    pub fn start(&self) -> Running {
        self.start_again(&[])
    }
    /// Starts the program and kills it with its stages after a barrier; then opens the gate for the next run.
    pub fn kill_at_barrier(&self, barrier: u64, stages: &[&str]) {
        let running = self.start();
        self.wait_for_barrier(barrier);
        let stages: Vec<_> = stages.iter().map(|stage| running.stage(stage)).collect();
        running.kill(true);
        wait_for("the stages' end", || stages.iter().all(|stage| !is_alive(*stage)).then_some(()));
        self.open_gate();
    }
    /// [`Launch::start`] with further arguments.
    pub fn start_again(&self, arguments: &[&str]) -> Running {
        self.spawn(self.command().args(arguments))
    }
    /// [`Launch::start`] with an environment variable.
    pub fn start_with_env(&self, key: &str, value: &str) -> Running {
        self.spawn(self.command().env(key, value))
    }
    fn spawn(&self, command: &mut Command) -> Running {
        let errors = std::fs::File::create(self.folder().join("stderr.txt")).expect("created");
        let child = command.stdout(Stdio::null()).stderr(errors).spawn().expect("replica-launch starts");
        Running::new(child, self.folder())
    }
    /// [`Launch::start`] by another user, who then owns the folder. Only the superuser may do so.
    pub fn start_as(&self, user: u32) -> Running {
        use std::os::unix::process::CommandExt;
        std::os::unix::fs::chown(self.folder(), Some(user), Some(user)).expect("the superuser may give files away");
        let errors = std::fs::File::create(self.folder().join("stderr.txt")).expect("created");
        let mut command = self.command();
        let child = command.uid(user).gid(user).stdout(Stdio::null()).stderr(errors).spawn();
        Running::new(child.expect("the superuser may start processes of other users"), self.folder())
    }
    /// [`Launch::start`] with closed stderr.
    pub fn start_with_closed_stderr(&self) -> Running {
        let mut child =
            self.command().stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("replica-launch starts");
        drop(child.stderr.take());
        Running::new(child, self.folder())
    }
    /// The messages of the last supervisor that was started here.
    pub fn stderr(&self) -> String {
        std::fs::read_to_string(self.folder().join("stderr.txt")).unwrap_or_default()
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

impl Drop for Launch {
    fn drop(&mut self) {
        for path in find_domain(&self.output()).iter().flat_map(|domain| leftovers(domain)) {
            // A process that is just ending may have removed it first.
            let _ = if Path::new(&path).is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        }
    }
}

/// Keys of the relay that make it wait in the step of this tick until [`Launch::open_gate`]: the run does not pass it,
/// however long a test takes to act in the middle of it.
pub fn gate(at_tick: u64) -> String {
    format!("fault = \"waits\"\nat_tick = {at_tick}\nonce = \"../gate\"\nstall_s = 600.0")
}

/// The seconds after `words` in a report.
pub fn reported_seconds(report: &str, words: &str) -> f64 {
    let seconds = report.split_once(words).and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok());
    seconds.unwrap_or_else(|| panic!("no seconds behind {words:?} in:\n{report}"))
}

/// Keys of `[run]` for busy machines, which always run a process within this time.
pub const PATIENT: &str = "hang_s = 120.0";

/// Keys of `[run]`, with the defaults [`PATIENT`] and no report, which few tests read.
pub(crate) fn patient(run: &str) -> String {
    let defaults = [("hang_s", PATIENT), ("report", "report = false")];
    let added = defaults.iter().filter(|(key, _)| !run.contains(key)).map(|(_, text)| format!("{text}\n"));
    added.collect::<String>() + run
}

/// Files in which a run describes itself, next to its results. They contain times.
const ABOUT_THE_RUN: [&str; 3] = ["summary.json", "report.html", "report.json"];

/// All files of a result folder by name, except files in which a run describes itself.
pub fn result_files(output: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in [output.to_owned(), output.join("clouds")] {
        // Only export creates clouds.
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.path().is_file() && !ABOUT_THE_RUN.contains(&name.as_str()) {
                files.insert(name, std::fs::read(entry.path()).expect("readable"));
            }
        }
    }
    files
}

/// One number for all files of [`result_files`] (FNV-1a).
pub fn digest(files: &BTreeMap<String, Vec<u8>>) -> u64 {
    let bytes = files.iter().flat_map(|(name, content)| name.bytes().chain([0]).chain(content.iter().copied()));
    bytes.fold(0xcbf2_9ce4_8422_2325, |digest, byte| (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Status and messages of a run, for assertions.
pub fn output_text(output: &Output) -> String {
    format!("{}\n{}", output.status, String::from_utf8_lossy(&output.stderr))
}
