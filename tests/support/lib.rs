//! Shared code of the process tests: launch files in separate folders, running supervisors, waiting for conditions,
//! kills at seeded moments, drives and reference results that are made once, another host, and mounts in a namespace.

mod browser;
mod drive;
mod foreign_copc;
mod kills;
mod launch;
mod namespace;
mod other_host;
pub mod power_loss;
mod processes;
mod recorded_kills;
mod running;
mod screen;
mod shared;
mod slurm;
pub mod swaps;

pub use browser::Browser;
pub use drive::{
    ANY_DEVIATION, ANY_FIXES, drive, lidar_pipeline, long_drive, pipeline, simulated_drive, two_lidar_drive,
};
pub use foreign_copc::{SIDE, write_foreign_copc};
pub use kills::{Kills, run_under_kills};
pub use launch::{Launch, PATIENT, digest, gate, output_text, reported_seconds, result_files};
pub use namespace::{
    Cable, mount_tmpfs, resize_tmpfs, run_in_own_namespace, runs_in_own_namespace, runs_in_own_network,
};
pub use other_host::{OtherHost, Proxy, run_under_cuts};
pub use processes::{domain_of, is_alive, leftovers, processes_of};
pub use random::Random;
pub use recorded_kills::{RECORDED_VICTIMS, RecordedKills, kill_while_recording};
pub use running::Running;
pub use screen::{Screen, Terminal};
pub use shared::{reference, undisturbed, undisturbed_lines};
pub use slurm::Slurm;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait, far more than any operation here takes on a busy machine; a test that waits for this long has failed.
const TIMEOUT: Duration = Duration::from_mins(3);

/// A program of the workspace. `cargo test --workspace` puts it next to the tests.
pub fn binary(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("a test has a path");
    let folder = tests.parent().and_then(Path::parent).expect("tests lie in target/<profile>/deps");
    let path = folder.join(name);
    assert!(path.is_file(), "{} does not exist: build the workspace first", path.display());
    path
}

/// Waits until `condition` returns a value.
pub fn wait_for<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(value) = condition() {
            return value;
        }
        assert!(begun.elapsed() < TIMEOUT, "no {what} after {} s", TIMEOUT.as_secs());
        std::thread::park_timeout(Duration::from_millis(5));
    }
}
