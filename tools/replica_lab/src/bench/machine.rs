//! The machine and the code version of a measurement.

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;

/// The machine and the version of the code.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the processor.
    pub cpu: String,
    /// Cores that this process may use.
    pub cores: usize,
    /// Bytes of memory.
    pub memory_bytes: u64,
    /// Release of the kernel.
    pub kernel: String,
    /// Load average over the last minute before the first run.
    pub load: f64,
    /// Short commit hash of the tree of the launch file, followed by `dirty` if files differ from it.
    pub commit: String,
    /// Version and commit of the programs, as `replica-lab --version`; empty in old reports. The programs may be from another tree than
    /// the launch file.
    #[serde(default)]
    pub version: String,
}

impl Machine {
    /// Reads /proc and asks git. Values that are not available become `unknown` or 0.
    pub fn detect(launch_file: &Path) -> Self {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let unknown = |text: Option<String>| text.filter(|text| !text.is_empty()).unwrap_or("unknown".to_owned());
        let value = |text: &str, key: &str| {
            let line = text.lines().find(|line| line.starts_with(key));
            line.and_then(|line| line.split_once(':')).map(|(_, value)| value.trim().to_owned())
        };
        let memory = value(&read("/proc/meminfo"), "MemTotal");
        let kib: Option<u64> = memory.and_then(|text| text.split(' ').next()?.parse().ok());
        let load = read("/proc/loadavg").split(' ').next().and_then(|text| text.parse().ok());
        Self {
            cpu: unknown(value(&read("/proc/cpuinfo"), "model name")),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_bytes: kib.unwrap_or_default() * 1024,
            kernel: unknown(Some(read("/proc/sys/kernel/osrelease").trim().to_owned())),
            load: load.unwrap_or_default(),
            commit: unknown(commit(launch_file)),
            version: env!("REPLICA_VERSION").to_owned(),
        }
    }
}

fn commit(launch_file: &Path) -> Option<String> {
    let folder = std::path::absolute(launch_file).ok()?.parent()?.to_owned();
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(&folder).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short", "HEAD"])?;
    let clean = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|changes| changes.is_empty());
    Some(if clean { commit } else { commit + " dirty" })
}
