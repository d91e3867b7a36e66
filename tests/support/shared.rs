//! Drives and reference results that many tests need: made once per build of the programs, by the first test or test
//! process that needs them.

use crate::launch::{output_text, result_files};
use crate::{Launch, binary};
use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// All programs on which results depend.
const PROGRAMS: [&str; 13] = [
    "replica",
    "replica-launch",
    "replica-acquire",
    "replica-calibrate",
    "replica-slam_aggregate",
    "replica-colorize",
    "replica-infer",
    "replica-instance",
    "replica-export",
    "replica-replay",
    "misbehaving-source",
    "misbehaving-relay",
    "misbehaving-sink",
];

/// The folder `name` with the content that `make` creates. It is made again when a program was rebuilt: results of
/// another version would test something else.
///
/// # Panics
/// If `make` panics; the next call tries again.
pub fn made_once(name: &str, programs: &[&str], make: impl FnOnce(&Path)) -> PathBuf {
    let folder = shared_folder();
    std::fs::create_dir_all(&folder).expect("a folder");
    let made = folder.join(format!("{name}.{:016x}", version(programs)));
    // All tests, of this process and of other processes, wait for the first one.
    let lock = File::create(folder.join(format!("{name}.lock"))).expect("a file");
    lock.lock().expect("a lock");
    if !made.exists() {
        remove_other_versions(&folder, name);
        let partial = folder.join(format!("{name}.partial"));
        std::fs::create_dir_all(&partial).expect("a folder");
        make(&partial);
        std::fs::rename(&partial, &made).expect("renamed");
    }
    made
}

fn shared_folder() -> PathBuf {
    let programs = binary("replica-launch");
    let profile = programs.parent().expect("programs lie in target/<profile>");
    profile.parent().expect("target").join("tmp/shared")
}

fn remove_other_versions(folder: &Path, name: &str) {
    let start = format!("{name}.");
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let is_other = entry.file_name().to_string_lossy().starts_with(&start) && entry.path().is_dir();
        if is_other {
            std::fs::remove_dir_all(entry.path()).expect("removed");
        }
    }
}

/// Changes with every build of one of the programs.
fn version(programs: &[&str]) -> u64 {
    let mut hasher = DefaultHasher::new();
    for program in programs {
        let metadata = std::fs::metadata(binary(program)).expect("a file");
        (program, metadata.len(), metadata.mtime(), metadata.mtime_nsec()).hash(&mut hasher);
    }
    hasher.finish()
}

/// A hash of a text, to name files that depend on it.
fn hash(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}

/// Result files of an undisturbed run of this launch file, made once for each `name`.
///
/// # Panics
/// If the run fails.
pub fn reference(name: &str, launch: impl FnOnce() -> Launch) -> BTreeMap<String, Vec<u8>> {
    let folder = made_once(&format!("reference_{name}"), &PROGRAMS, |folder| {
        let launch = launch();
        let output = launch.run();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
        for (name, bytes) in result_files(&launch.output()) {
            std::fs::write(folder.join(name), bytes).expect("written");
        }
    });
    result_files(&folder)
}

/// The output of the sink of the small pipeline in an undisturbed run, with the tables `source` and `relay`.
pub fn undisturbed(source: &str, relay: &str) -> Vec<u8> {
    let name = format!("small_{:016x}", hash(&format!("{source}\n\n{relay}")));
    reference(&name, || Launch::misbehaving("", source, relay)).remove("sink.txt").expect("the sink has written")
}

/// The lines that the sink writes in an undisturbed run of `n_ticks` ticks of 1000 points: two for each tick.
pub fn undisturbed_lines(n_ticks: usize, relay: &str) -> Vec<String> {
    // A line depends only on its tick, so that one longer run serves many tests.
    let n_reference = n_ticks.next_power_of_two().max(1024);
    let text = undisturbed(&format!("ticks = {n_reference}\npoints = 1000"), relay);
    let text = String::from_utf8(text).expect("text");
    text.lines().take(2 * n_ticks).map(str::to_owned).collect()
}
