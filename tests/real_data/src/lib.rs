//! Third-party recordings for tests. They are in `../shared/data` next to the project;
//! `fetch.py` downloads them (`docs/guide/test_data.md`).
//!
//! | `REPLICA_DATA` | folder | a test whose data is absent |
//! |---|---|---|
//! | not set | `../shared/data` | is listed as ignored, with the reason |
//! | `required` | `../shared/data` | fails |
//! | a path | that folder | is listed as ignored, with the reason |
//!
//! A folder, or a pattern with one `*`, stands for the files that `sources.json` lists for it: a test runs only if all of them exist.
//!
//! ```
//! #[real_data::test("kitti00/000094.bin")]
//! fn real_sweep_has_finite_points() {
//!     let sweep = real_data::path("kitti00/000094.bin");
//!     assert!(sweep.is_file());
//! }
//! ```

use std::path::{Path, PathBuf};

/// Marks a test that reads these files, folders or patterns (`"kitti_raw_0048/*.pcd"`), relative to the data folder. It replaces `#[test]`.
///
/// Presence is checked when the test is compiled: the test harness can only ignore tests that were ignored at that
/// time.
pub use real_data_macros::test;

/// Path of a file or folder of the data.
///
/// # Panics
/// If it does not exist: the attribute of the test did not name it, it was removed after the test was compiled, or
/// `REPLICA_DATA=required` and the data is absent.
pub fn path(name: &str) -> PathBuf {
    let path = folder().join(name);
    assert!(path.exists(), "real data {name} is absent: {} does not exist", path.display());
    path
}

/// Path of a file or folder of the data, if it exists: for examples and experiments, which report themselves what they
/// need.
pub fn find(name: &str) -> Option<PathBuf> {
    Some(folder().join(name)).filter(|path| path.exists())
}

fn folder() -> PathBuf {
    match std::env::var_os("REPLICA_DATA") {
        Some(setting) if setting != "required" => PathBuf::from(setting),
        _ => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    }
}
