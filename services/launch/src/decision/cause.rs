//! Exhausted resources: disk, shared memory, memory, file size. The cause of a fault determines whether a restart can
//! help.

use std::fmt;

const SIGBUS: i32 = 7;
const SIGKILL: i32 = 9;
const SIGXFSZ: i32 = 25;

/// Errors of the operating system in a stage's log that no restart removes, with advice.
const OS_ERRORS: [(&str, &str); 4] = [
    ("(os error 27)", "a file reached the largest size allowed (ulimit -f): raise the limit"),
    ("(os error 28)", "a disk is full: make room"),
    ("(os error 30)", "a file system is read-only: make it writable"),
    ("(os error 122)", "a disk quota is exhausted: make room"),
];

/// Figures at the time of a fault.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// Last lines of the stage's log.
    pub log_lines: Vec<String>,
    /// The kernel has killed a process for lack of memory since the last fault.
    pub has_kernel_killed: bool,
    /// Bytes free on the disk of the output, if they can be read.
    pub free_disk: Option<u64>,
    /// Bytes of shared memory free, if they can be read.
    pub free_shared_memory: Option<u64>,
    /// Bytes of shared memory that this run uses.
    pub used_shared_memory: u64,
}

/// An exhausted resource.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Disk space, a quota, or write permission.
    Disk {
        /// The exhausted resource, with advice.
        advice: &'static str,
        /// Bytes free on the disk of the output.
        free: Option<u64>,
    },
    /// Mapped memory.
    SharedMemory {
        /// Bytes free.
        free: Option<u64>,
        /// Bytes that this run uses.
        used: u64,
    },
    /// Memory: the kernel ended the process.
    Memory,
    /// The limit on the size of a file.
    FileSize,
}

impl Cause {
    /// The exhausted resource that explains a fault, if any. `signal`: the signal that ended the stage.
    pub fn from_evidence(signal: Option<i32>, evidence: &Evidence) -> Option<Self> {
        let is_logged = |error: &str| evidence.log_lines.iter().any(|line| line.contains(error));
        if let Some((_, advice)) = OS_ERRORS.iter().find(|(error, _)| is_logged(error)) {
            return Some(Self::Disk { advice, free: evidence.free_disk });
        }
        match signal {
            Some(SIGBUS) => {
                Some(Self::SharedMemory { free: evidence.free_shared_memory, used: evidence.used_shared_memory })
            }
            Some(SIGKILL) if evidence.has_kernel_killed => Some(Self::Memory),
            Some(SIGXFSZ) => Some(Self::FileSize),
            _ => None,
        }
    }

    /// Whether a restart can help. A restart frees memory, but neither makes room on a disk nor raises a limit.
    pub(super) fn may_restart(&self) -> bool {
        matches!(self, Self::SharedMemory { .. } | Self::Memory)
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disk { advice, free } => {
                write!(f, "{advice}, then continue with --resume ({} free on the disk of the output)", mib(*free))
            }
            Self::SharedMemory { free, used } => {
                write!(f, "{} free in /dev/shm, this run uses {}", mib(*free), mib(Some(*used)))
            }
            Self::Memory => write!(f, "the kernel killed it: memory was exhausted"),
            Self::FileSize => write!(f, "raise the limit, then continue with --resume"),
        }
    }
}

/// An amount of memory as text.
pub fn mib(bytes: Option<u64>) -> String {
    bytes
        .map_or_else(|| "an unknown amount".to_owned(), |bytes| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20)))
}
