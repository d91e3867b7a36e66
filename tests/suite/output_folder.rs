//! An output folder belongs to one run: the next run replaces its results only on request.

use replica_tests::{Launch, output_text, undisturbed};
use std::os::unix::fs::MetadataExt;

const SOURCE: &str = "ticks = 20\npoints = 500";

/// Name, content and time of change of every file of the output.
fn files(launch: &Launch) -> Vec<(String, Vec<u8>, i64)> {
    let mut folders = vec![launch.output()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            if entry.path().is_dir() {
                folders.push(entry.path());
                continue;
            }
            let changed = entry.metadata().expect("a file").mtime_nsec();
            let bytes = std::fs::read(entry.path()).expect("readable");
            files.push((entry.path().display().to_string(), bytes, changed));
        }
    }
    files.sort();
    files
}

#[test]
fn second_run_into_a_used_output_is_refused_and_changes_nothing() {
    let launch = Launch::misbehaving("", SOURCE, "");
    assert_eq!(launch.run().status.code(), Some(0));
    let before = files(&launch);
    let second = launch.run();
    let text = output_text(&second);
    assert_eq!(second.status.code(), Some(78), "{text}");
    assert!(text.contains("out: holds the results of a run that ended as `done`"), "{text}");
    assert!(text.contains("set another run.output, or add --overwrite to replace them"), "{text}");
    assert!(files(&launch) == before, "the refused run has changed the results");
}

#[test]
fn overwrite_replaces_the_results() {
    let launch = Launch::misbehaving("", SOURCE, "");
    assert_eq!(launch.run().status.code(), Some(0));
    std::fs::write(launch.output().join("sink.txt"), "of the first run").expect("written");
    let launch = launch.with("--overwrite");
    let second = launch.run();
    assert_eq!(second.status.code(), Some(0), "{}", output_text(&second));
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""));
}

#[test]
fn run_that_failed_before_its_first_point_may_be_repeated() {
    let launch = Launch::misbehaving("restarts = 0", SOURCE, "fault = \"error\"\nat_tick = 0");
    for _ in 0..2 {
        let output = launch.run();
        assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    }
}

#[test]
fn check_names_earlier_results() {
    let launch = Launch::misbehaving("", SOURCE, "");
    assert_eq!(launch.run().status.code(), Some(0));
    let checked = launch.with("--check").run();
    assert_eq!(checked.status.code(), Some(0), "{}", output_text(&checked));
    let stdout = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert!(stdout.contains("holds the results of a run that ended as `done`"), "{stdout}");
}
