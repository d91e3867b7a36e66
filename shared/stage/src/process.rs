//! What the operating system says about this process and its program, and what it is told.

use crate::StepError;
use rustix::time::{ClockId, clock_gettime};
use std::path::{Path, PathBuf};

/// CPU time and memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Usage {
    /// User and system time of all threads, s.
    pub cpu_s: f64,
    /// Resident memory, bytes; shared memory that was touched counts too.
    pub rss_bytes: u64,
    /// Largest resident memory so far, bytes.
    pub peak_rss_bytes: u64,
}

/// From the process clock and /proc/self; zeros where it cannot be read.
pub fn usage() -> Usage {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = |key: &str| {
        let line = status.lines().find(|line| line.starts_with(key));
        line.and_then(|line| line.split_whitespace().nth(1)).and_then(|kib| kib.parse::<u64>().ok()).unwrap_or_default()
    };
    Usage {
        cpu_s: nanos_of(ClockId::ProcessCPUTime) as f64 * 1e-9,
        rss_bytes: kib("VmRSS:") * 1024,
        peak_rss_bytes: kib("VmHWM:") * 1024,
    }
}

/// The monotonic clock, the same for all processes of the machine.
pub fn monotonic_nanos() -> u64 {
    nanos_of(ClockId::Monotonic)
}

/// User and system time of the calling thread.
pub fn thread_cpu_nanos() -> u64 {
    nanos_of(ClockId::ThreadCPUTime)
}

fn nanos_of(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Folder in which this program lies. All programs of the project lie in one.
pub fn own_folder() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    own.parent().unwrap_or(Path::new(".")).to_owned()
}

/// Another program of the project. The error is a sentence.
pub fn sibling(name: &str) -> Result<PathBuf, String> {
    let path = own_folder().join(name);
    if path.is_file() { Ok(path) } else { Err(format!("program {} is not there", path.display())) }
}

/// Asks the kernel to kill this process when its supervisor dies: no run leaves orphans.
pub fn die_with(supervisor: u32) -> Result<(), StepError> {
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL)).map_err(StepError::io)?;
    // It may have died before the request.
    let parent = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get());
    if parent == i32::try_from(supervisor).ok() {
        return Ok(());
    }
    Err(StepError::Io(format!("the supervisor (process {supervisor}) is gone")))
}

/// The files that a process of this user has open; of others' processes, and of those that have ended, there are none to see.
pub fn open_files(pid: u32) -> impl Iterator<Item = PathBuf> {
    let descriptors = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
    descriptors.filter_map(|descriptor| std::fs::read_link(descriptor.path()).ok())
}
