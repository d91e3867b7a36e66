//! What the process tests share: launch files in a folder of their own, running supervisors, waiting for conditions, kills at
//! seeded moments, and mounts that nobody else sees.

mod drive;
mod kills;
mod launch;
mod namespace;
mod processes;
mod random;
mod running;
pub mod swaps;

pub use drive::{pipeline, simulated_drive};
pub use kills::{Kills, run_under_kills};
pub use launch::{Launch, PATIENT, digest, gate, result_files, said, seconds_told, undisturbed};
pub use namespace::{in_own_namespace, mount_tmpfs, resize_tmpfs};
pub use processes::{domain_of, is_alive, leftovers, processes_of};
pub use random::Random;
pub use running::Running;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Far more than anything here takes on a busy machine; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_mins(3);

/// A binary of the workspace. `cargo test --workspace` has built it beside the tests.
pub fn binary(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("a test has a path");
    let folder = tests.parent().and_then(Path::parent).expect("tests lie in target/<profile>/deps");
    let path = folder.join(name);
    assert!(path.is_file(), "{} is not there: build the workspace first", path.display());
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
