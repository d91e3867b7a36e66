//! An output folder belongs to one run: the next run replaces its results only on request.

use replica_tests::{Launch, binary, gate, output_text, undisturbed, wait_for};
use std::os::unix::fs::MetadataExt;
use std::process::Command;

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
fn copied_output_of_a_live_run_has_no_part_in_it() {
    let launch = Launch::misbehaving("", SOURCE, &gate(19));
    let running = launch.start();
    launch.wait_for_barrier(2);
    let copy = launch.folder().join("copy");
    // Stages that are still saving rename files while they are copied; the gate ends that.
    wait_for("a copy of all files", || {
        let _absent_at_first = std::fs::remove_dir_all(&copy);
        let copied = Command::new("cp").arg("-a").arg(launch.output()).arg(&copy).status();
        copied.expect("cp").success().then_some(())
    });
    let stop = Command::new(binary("replica")).args(["stop", "--run"]).arg(&copy).output().expect("replica");
    let text = output_text(&stop);
    assert!(!stop.status.success() && text.contains("copy is not alive"), "{text}");
    let second = launch.start_again(&["--overwrite", "--set", "run.output=copy"]);
    let supervisor = second.pid().as_raw_nonzero().get();
    wait_for("the stages of the second run", || {
        let wiring = std::fs::read(copy.join("run/wiring.json")).ok()?;
        let wiring: serde_json::Value = serde_json::from_slice(&wiring).ok()?;
        (wiring["supervisor"] == supervisor && copy.join("run/states/2").exists()).then_some(())
    });
    launch.open_gate();
    assert_eq!(second.wait(), Some(0), "{}", launch.stderr());
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    let expected = undisturbed(SOURCE, "");
    assert!(launch.read("sink.txt") == expected, "the run of the copy changed the original");
    assert!(std::fs::read(copy.join("sink.txt")).expect("written") == expected, "the run of the copy");
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
