//! A run leaves no files behind, and runs do not interfere.

use replica_tests::{Launch, domain_of, is_alive, leftovers, output_text, processes_of, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};
use std::os::unix::fs::{MetadataExt, PermissionsExt};

const ENDLESS: &str = "ticks = 1000000\npoints = 100000";

#[test]
fn finished_run_leaves_nothing_in_shared_memory() {
    let launch = Launch::misbehaving("", "ticks = 5", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn killed_supervisor_takes_its_stages_along_and_the_next_run_cleans_up() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = launch.start();
    let stages = ["source", "relay", "sink"].map(|stage| running.stage(stage));
    launch.wait_for_barrier(1);
    running.signal(Signal::KILL);
    wait_for("the stages' end", || stages.iter().all(|stage| !is_alive(*stage)).then_some(()));
    let domain = domain_of(&launch.output());
    assert!(!leftovers(&domain).is_empty(), "SIGKILL leaves shared memory, or this test shows nothing");
    drop(running);

    // The same output: the next run removes what the killed run left, and leaves nothing itself.
    let output = launch.with("--overwrite").with("--set").with("source.ticks=3").run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert_eq!(leftovers(&domain), Vec::<String>::new());
}

/// A closed terminal closes stderr and sends SIGHUP: the run drains and leaves nothing behind.
#[test]
fn closed_terminal_drains_the_run() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = launch.start_with_closed_stderr();
    launch.wait_for_barrier(1);
    running.signal(Signal::HUP);
    assert_eq!(running.wait(), Some(3));
    assert_eq!(launch.summary()["outcome"], "drained");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn simultaneous_runs_do_not_interfere() {
    let [first, second] =
        [700, 701].map(|points| Launch::misbehaving("", &format!("ticks = 30\npoints = {points}"), ""));
    let runs = [first.start(), second.start()];
    for run in runs {
        assert_eq!(run.wait(), Some(0));
    }
    assert_ne!(domain_of(&first.output()), domain_of(&second.output()));
    for (launch, points) in [(&first, 700), (&second, 701)] {
        let alone = undisturbed(&format!("ticks = 30\npoints = {points}"), "");
        assert!(launch.read("sink.txt") == alone, "the run with {points} points was disturbed");
    }
}

/// The number of `nobody` on all Linux systems.
const NOBODY: u32 = 65534;

#[test]
#[cfg_attr(not(other_users), ignore = "needs the superuser, and programs that all users can read")]
fn runs_of_two_users_do_not_interfere() {
    let [own, other] = [700, 701]
        .map(|points| Launch::misbehaving("", &format!("ticks = 1000000\npoints = {points}\npace_ms = 1"), ""));
    let theirs = other.start_as(NOBODY);
    let ours = own.start();
    for launch in [&own, &other] {
        launch.wait_for_barrier(2);
    }
    for (launch, user) in [(&own, rustix::process::getuid().as_raw()), (&other, NOBODY)] {
        let files = leftovers(&domain_of(&launch.output()));
        assert!(!files.is_empty());
        for file in files {
            // A file may be removed in the meantime.
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

/// Another user could prepare files with the name that a run would use.
#[test]
#[cfg_attr(not(other_users), ignore = "needs the superuser, and programs that all users can read")]
fn files_of_another_user_do_not_block_an_output() {
    let launch = Launch::misbehaving("", "ticks = 5", "").with("--overwrite");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    for (start, end) in [("/dev/shm/replica_", ""), ("/dev/shm/replica_", "_prepared"), ("/tmp/replica_", "_control")] {
        let domain = domain_of(&launch.output());
        let prepared = format!("{start}{domain}{end}");
        std::fs::create_dir(&prepared).expect("made");
        std::os::unix::fs::chown(&prepared, Some(NOBODY), Some(NOBODY)).expect("the superuser may give files away");
        let output = launch.run();
        std::fs::remove_dir(&prepared).expect("files of other users stay");
        assert_eq!(leftovers(&domain), Vec::<String>::new());
        assert_eq!(output.status.code(), Some(0), "{prepared}: {}", output_text(&output));
        assert_ne!(domain_of(&launch.output()), domain, "the name of {prepared} is not used");
    }
}

#[test]
fn files_of_a_run_are_not_readable_by_others() {
    let launch = Launch::misbehaving("", "ticks = 5", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    for name in ["run", "run/lock", "run/domain"] {
        let mode = std::fs::metadata(launch.output().join(name)).expect("there").permissions().mode();
        assert_eq!(mode & 0o077, 0, "{name} has mode {mode:o}");
    }
}

#[test]
fn second_run_into_the_same_output_is_refused() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = launch.start();
    let relay = running.stage("relay");
    let second = launch.run();
    assert_eq!(second.status.code(), Some(1), "{}", output_text(&second));
    assert!(output_text(&second).contains("another run is writing here"), "{}", output_text(&second));
    assert!(is_alive(relay), "the first run continues");
    kill_process(running.pid(), Signal::TERM).expect("the supervisor lives");
    assert_eq!(running.wait(), Some(3));
    assert!(processes_of(std::process::id()).iter().all(|pid| *pid != relay));
}
