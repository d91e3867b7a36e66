//! A run leaves nothing behind, and no run meets another.

use replica_tests::{Launch, domain_of, is_alive, leftovers, processes_of, said, wait_for};
use rustix::process::{Signal, kill_process};
use std::os::unix::fs::{MetadataExt, PermissionsExt};

const ENDLESS: &str = "ticks = 1000000\npoints = 100000";

#[test]
fn nothing_stays_after_a_run() {
    let launch = Launch::of_misbehaving("", "ticks = 5", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn stages_die_with_their_supervisor_and_the_next_start_cleans_up() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = launch.start();
    let stages = ["source", "relay", "sink"].map(|stage| running.stage(stage));
    launch.wait_for_barrier(1);
    running.signal(Signal::KILL);
    wait_for("the stages' end", || stages.iter().all(|stage| !is_alive(*stage)).then_some(()));
    let domain = domain_of(&launch.output());
    assert!(!leftovers(&domain).is_empty(), "SIGKILL leaves shared memory, or this test shows nothing");
    drop(running);

    // The same output folder: the next start finds what the dead run left, and its own run then leaves nothing.
    let output = launch.with("--set").with("source.ticks=3").run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(leftovers(&domain), Vec::<String>::new());
}

/// A terminal that is closed takes stderr with it and sends SIGHUP: the run drains, and nothing of it stays.
#[test]
fn a_closed_terminal_drains_the_run() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = launch.start_with_closed_stderr();
    launch.wait_for_barrier(1);
    running.signal(Signal::HUP);
    assert_eq!(running.wait(), Some(3));
    assert_eq!(launch.summary()["outcome"], "drained");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn two_runs_side_by_side_do_not_meet() {
    let [first, second] =
        [700, 701].map(|points| Launch::of_misbehaving("", &format!("ticks = 30\npoints = {points}"), ""));
    let runs = [first.start(), second.start()];
    for run in runs {
        assert_eq!(run.wait(), Some(0));
    }
    assert_ne!(domain_of(&first.output()), domain_of(&second.output()));
    for (launch, points) in [(&first, 700), (&second, 701)] {
        let alone = Launch::of_misbehaving("", &format!("ticks = 30\npoints = {points}"), "");
        assert_eq!(alone.run().status.code(), Some(0));
        assert!(launch.read("sink.txt") == alone.read("sink.txt"), "the run with {points} points was disturbed");
    }
}

/// The number of `nobody` on all Linux systems.
const NOBODY: u32 = 65534;

/// Only the superuser may start processes of other users.
#[test]
fn runs_of_two_users_do_not_meet() {
    let [own, other] = [700, 701]
        .map(|points| Launch::of_misbehaving("", &format!("ticks = 1000000\npoints = {points}\npace_ms = 1"), ""));
    let Some(theirs) = other.start_as(NOBODY) else {
        eprintln!("runs_of_two_users_do_not_meet: skipped, a process of another user cannot be started here");
        return;
    };
    let ours = own.start();
    for launch in [&own, &other] {
        launch.wait_for_barrier(2);
    }
    for (launch, user) in [(&own, rustix::process::getuid().as_raw()), (&other, NOBODY)] {
        let files = leftovers(&domain_of(&launch.output()));
        assert!(!files.is_empty());
        for file in files {
            // A file may go while we look.
            let Ok(about) = std::fs::symlink_metadata(&file) else { continue };
            let others = about.permissions().mode() & 0o077;
            assert_eq!((about.uid(), others), (user, 0), "{file}");
        }
    }
    for running in [ours, theirs] {
        running.signal(Signal::TERM);
        assert_eq!(running.wait(), Some(3));
    }
    for launch in [&own, &other] {
        assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
    }
}

#[test]
fn a_second_run_into_the_same_folder_is_refused() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = launch.start();
    let relay = running.stage("relay");
    let second = launch.run();
    assert_eq!(second.status.code(), Some(1), "{}", said(&second));
    assert!(said(&second).contains("another run is writing here"), "{}", said(&second));
    assert!(is_alive(relay), "the first run goes on");
    kill_process(running.pid(), Signal::TERM).expect("the supervisor lives");
    assert_eq!(running.wait(), Some(3));
    assert!(processes_of(std::process::id()).iter().all(|pid| *pid != relay));
}
