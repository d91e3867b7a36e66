//! Statistics of this process and its program from the operating system.

use crate::threads::{bounded_environment, max_threads};
use rustix::process::{Resource, getrlimit};
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Resources that a process has used so far, and its current memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Usage {
    /// User and system time of all threads, s.
    pub cpu_s: f64,
    /// Resident memory, bytes; shared memory that was touched counts too.
    pub rss_bytes: u64,
    /// Largest resident memory so far, bytes.
    pub peak_rss_bytes: u64,
    /// Resident memory that no other process shares, bytes.
    pub private_bytes: u64,
    /// Pages that the process touched first, or that were not in memory.
    pub page_faults: u64,
    /// Bytes read by calls, of files and sockets.
    pub read_bytes: u64,
    /// Bytes written by calls, to files and sockets.
    pub written_bytes: u64,
}

/// Reads the process clock and /proc/self; values that cannot be read are zero.
pub fn usage() -> Usage {
    let status = Fields::read("/proc/self/status");
    let io = Fields::read("/proc/self/io");
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in parentheses, may contain spaces.
    let numbers = stat.rsplit_once(") ").map_or("", |(_, numbers)| numbers);
    let stat = |index: usize| numbers.split(' ').nth(index).and_then(|number| number.parse::<u64>().ok());
    Usage {
        cpu_s: nanos_of(ClockId::ProcessCPUTime) as f64 * 1e-9,
        rss_bytes: status.number("VmRSS:") * 1024,
        peak_rss_bytes: status.number("VmHWM:") * 1024,
        private_bytes: status.number("RssAnon:") * 1024,
        page_faults: stat(MINOR_FAULTS).unwrap_or_default() + stat(MAJOR_FAULTS).unwrap_or_default(),
        read_bytes: io.number("rchar:"),
        written_bytes: io.number("wchar:"),
    }
}

/// Position in /proc/self/stat after the name of the program.
const MINOR_FAULTS: usize = 7;
const MAJOR_FAULTS: usize = 9;

/// A file of /proc with a named number in each line.
struct Fields(String);

impl Fields {
    fn read(path: &str) -> Self {
        Self(std::fs::read_to_string(path).unwrap_or_default())
    }
    /// The first number of the line that starts with `name`; 0 without such a line.
    fn number(&self, name: &str) -> u64 {
        let line = self.0.lines().find(|line| line.starts_with(name));
        line.and_then(|line| line.split_whitespace().nth(1)).and_then(|number| number.parse().ok()).unwrap_or_default()
    }
}

/// The monotonic clock, the same for all processes of the machine.
pub fn monotonic_nanos() -> u64 {
    nanos_of(ClockId::Monotonic)
}

/// The monotonic clock, which also counts the time in which the machine is suspended.
pub fn boottime_nanos() -> u64 {
    nanos_of(ClockId::Boottime)
}

/// User and system time of the calling thread.
pub fn thread_cpu_nanos() -> u64 {
    nanos_of(ClockId::ThreadCPUTime)
}

fn nanos_of(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Folder of this program. All programs of the project are in one folder.
pub fn own_folder() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    own.parent().unwrap_or(Path::new(".")).to_owned()
}

/// A program of the project that is not installed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("program {} does not exist", path.display())]
pub struct ProgramMissing {
    /// Expected path.
    pub path: PathBuf,
}

/// Another program of the project.
pub fn sibling(name: &str) -> Result<PathBuf, ProgramMissing> {
    let path = own_folder().join(name);
    if path.is_file() { Ok(path) } else { Err(ProgramMissing { path }) }
}

/// The program that a table names: a file, its path relative to `folder`, or the name of another program of the project.
pub fn named_program(program: &str, folder: &Path) -> Result<PathBuf, ProgramMissing> {
    let path = folder.join(program);
    let own = || program.starts_with("replica-").then(|| sibling(program)).and_then(Result::ok);
    if path.is_file() { Ok(path) } else { own().ok_or(ProgramMissing { path }) }
}

/// The interpreter that a table names: a command of the search path, or a path relative to `folder`.
pub fn interpreter(python: &str, folder: &Path) -> String {
    let is_path = python.contains('/');
    if is_path { folder.join(python).to_string_lossy().into_owned() } else { python.to_owned() }
}

/// Stack of a main thread, bytes, as most systems have it.
const STACK_BYTES: usize = 8 << 20;

/// Runs the whole program. Where the limit of the stack (`ulimit -s`) is so small that deep calls would abort, it runs in
/// a thread with a stack of its own.
///
/// # Panics
/// If that thread cannot be started, or if `program` panics.
pub fn with_enough_stack<R: Send>(program: impl FnOnce() -> R + Send) -> R {
    let is_small = getrlimit(Resource::Stack).current.is_some_and(|limit| limit < STACK_BYTES as u64);
    if !is_small {
        return program();
    }
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("main".to_owned()).stack_size(STACK_BYTES);
        let running = thread.spawn_scoped(scope, program).expect("a thread with 8 MiB of stack starts");
        running.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// The command that starts a stage's program: `*.py` with the interpreter `python`, any other by itself. `n_threads` is for its
/// parallel loops; 0 = one per core.
pub fn stage_command(program: &Path, python: &str, n_threads: usize) -> Command {
    let mut command = if program.extension().is_none_or(|extension| extension != "py") {
        Command::new(program)
    } else {
        let mut command = Command::new(python);
        // Python orders sets by a seed, which it would draw anew in each process. Unbuffered output puts lines in the
        // log before a crash.
        command.env("PYTHONHASHSEED", "0").env("PYTHONUNBUFFERED", "1").arg(program);
        command
    };
    // Threads would get the smallest stack that the variable names.
    command.env_remove("RUST_MIN_STACK");
    let n_threads = if n_threads > 0 { Some(n_threads.min(max_threads())) } else { bounded_environment() };
    if let Some(n_threads) = n_threads {
        // Thread counts of Rust and of OpenMP in Python libraries.
        let n_threads = n_threads.to_string();
        command.env("RAYON_NUM_THREADS", &n_threads).env("OMP_NUM_THREADS", n_threads);
    }
    command
}

/// The signal by which a supervisor stops its stages. Programs without a handler also end with it.
pub const STOP_STAGE: rustix::process::Signal = rustix::process::Signal::USR1;

/// A process that cannot be bound to its supervisor.
#[derive(Debug, thiserror::Error)]
pub enum SupervisorError {
    /// The kernel refused the death signal.
    #[error("death signal of the supervisor: {0}")]
    Signal(#[source] std::io::Error),
    /// The supervisor is not, or no longer, the parent of this process.
    #[error("the supervisor (process {supervisor}) has ended")]
    Ended {
        /// Its process id.
        supervisor: u32,
    },
}

/// Asks the kernel to kill this process when its supervisor ends, so that no run leaves processes behind.
pub fn end_with(supervisor: u32) -> Result<(), SupervisorError> {
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))
        .map_err(|errno| SupervisorError::Signal(errno.into()))?;
    // The supervisor may have ended before the request.
    let parent = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get());
    if parent == i32::try_from(supervisor).ok() {
        return Ok(());
    }
    Err(SupervisorError::Ended { supervisor })
}

/// The files that a process of this user has open. Empty for processes of other users and for processes that have ended.
pub fn open_files(pid: u32) -> impl Iterator<Item = PathBuf> {
    let descriptors = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
    descriptors.filter_map(|descriptor| std::fs::read_link(descriptor.path()).ok())
}
