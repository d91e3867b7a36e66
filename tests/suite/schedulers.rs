//! Schedulers of clusters: SIGTERM to every process of a job, and two hosts with one output.

use replica_tests::{Launch, domain_of, gate, leftovers, processes_of, undisturbed, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Slow enough that a signal comes before the end.
const PACED: &str = "ticks = 60\npoints = 500\npace_ms = 50";
const SOURCE: &str = "ticks = 60\npoints = 500";
const STAGES: [&str; 3] = ["source", "relay", "sink"];

/// A process and all its descendants, the youngest first: a signal reaches stages before their supervisor.
fn with_descendants(pid: Pid) -> Vec<Pid> {
    let children = processes_of(pid.as_raw_nonzero().get().unsigned_abs());
    let mut all: Vec<Pid> = children.into_iter().flat_map(with_descendants).collect();
    all.push(pid);
    all
}

fn signal_all(pid: Pid) {
    let all = with_descendants(pid);
    assert_eq!(all.len(), 1 + STAGES.len(), "supervisor and stages");
    for process in all {
        kill_process(process, Signal::TERM).expect("it lives");
    }
}

#[test]
fn sigterm_to_all_processes_drains_the_run_and_it_continues_with_the_same_bytes() {
    let launch = Launch::misbehaving("", PACED, "");
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 1);
    // Schedulers repeat it, and parents forward it.
    signal_all(running.pid());
    wait_for("the drain", || running.stderr().contains("draining").then_some(()));
    let _ = kill_process(running.pid(), Signal::TERM);
    assert_eq!(running.wait(), Some(3), "{}", launch.stderr());
    assert_eq!(launch.summary()["outcome"], "drained", "{}", launch.stderr());
    assert_eq!(launch.summary()["faults"], serde_json::json!([]));
    let again = launch.start_again(&["--resume"]);
    assert_eq!(again.wait(), Some(0), "{}", launch.stderr());
    assert!(launch.stderr().contains("resuming from barrier"), "{}", launch.stderr());
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "the signal changed the result");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
fn sigterm_to_all_processes_at_any_moment_loses_no_barrier() {
    for barrier in [0, 2, 4] {
        let launch = Launch::misbehaving("", PACED, "");
        let running = launch.start();
        let stages = STAGES.map(|stage| running.stage(stage));
        if barrier > 0 {
            launch.wait_for_barrier(barrier);
        }
        for process in stages.into_iter().chain([running.pid()]) {
            kill_process(process, Signal::TERM).expect("it lives");
        }
        let code = running.wait();
        // A stage that had not ignored the signal yet ends by it: the run then stops instead of draining.
        assert!(matches!(code, Some(1 | 3)), "{code:?}: {}", launch.stderr());
        assert_ne!(launch.summary()["outcome"], "failed", "{}", launch.stderr());
        let again = launch.start_again(&["--resume"]);
        assert_eq!(again.wait(), Some(0), "{}", launch.stderr());
        assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "from barrier {barrier}");
    }
}

/// The file of a lease as another kernel writes it.
fn write_foreign_lease(output: &Path, epoch: u64, renewals: u64, released: bool) {
    let record = serde_json::json!({
        "host": "elsewhere", "boot_id": "another kernel", "pid": 4711, "renewals": renewals, "released": released,
    });
    let folder = output.join("run/leases");
    std::fs::create_dir_all(&folder).expect("made");
    std::fs::write(folder.join(format!("{epoch}.json")), record.to_string()).expect("written");
}

#[test]
fn run_that_lost_its_lease_ends_without_a_result() {
    let launch = Launch::misbehaving("", SOURCE, &gate(40));
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 1);
    // A run on another host has taken the output over while this one stood still.
    write_foreign_lease(&launch.output(), 2, 0, false);
    assert_eq!(running.wait(), Some(1), "{}", launch.stderr());
    assert!(launch.stderr().contains("leases/2.json: another run has taken over this output"), "{}", launch.stderr());
    assert!(!launch.output().join("summary.json").exists(), "it may not write");
    write_foreign_lease(&launch.output(), 2, 1, true);
    launch.open_gate();
    assert_eq!(launch.start_again(&["--resume"]).wait(), Some(0), "{}", launch.stderr());
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""));
    let leases = std::fs::read_dir(launch.output().join("run/leases")).expect("a folder").flatten();
    let names: Vec<_> = leases.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    assert_eq!(names, ["3.json"], "released, and the old ones are removed");
}

#[test]
fn output_of_a_living_run_on_another_host_is_refused_by_name() {
    let launch = Launch::misbehaving("", SOURCE, "");
    write_foreign_lease(&launch.output(), 1, 0, false);
    let is_ended = AtomicBool::new(false);
    let code = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut renewals = 0;
            while !is_ended.load(Ordering::Relaxed) {
                renewals += 1;
                write_foreign_lease(&launch.output(), 1, renewals, false);
                std::thread::park_timeout(std::time::Duration::from_millis(20));
            }
        });
        let code = launch.start().wait();
        is_ended.store(true, Ordering::Relaxed);
        code
    });
    assert_eq!(code, Some(1), "{}", launch.stderr());
    assert!(launch.stderr().contains("a run on host elsewhere (process 4711) is writing here"), "{}", launch.stderr());
    assert!(!launch.output().join("sink.txt").exists(), "it has not started");
}

#[test]
fn second_run_waits_for_the_first_and_finds_it_done() {
    let launch = Launch::misbehaving("", SOURCE, &gate(40));
    let first = launch.start();
    launch.wait_for_barrier_of("sink", 1);
    let mut second = std::process::Command::new(replica_tests::binary("replica-launch"));
    second.arg(launch.folder().join("launch.toml")).args(["--resume", "--wait", "600"]);
    let mut second = second.stderr(std::process::Stdio::piped()).spawn().expect("starts");
    // It has the lock open as soon as it waits.
    let lock = launch.output().canonicalize().expect("a path").join("run/lock");
    wait_for("the second run", || {
        let open = std::fs::read_dir(format!("/proc/{}/fd", second.id())).ok()?.flatten();
        open.filter_map(|entry| std::fs::read_link(entry.path()).ok()).any(|file| file == lock).then_some(())
    });
    launch.open_gate();
    assert_eq!(first.wait(), Some(0), "{}", launch.stderr());
    let status = second.wait().expect("waits");
    let mut text = String::new();
    std::io::Read::read_to_string(&mut second.stderr.take().expect("piped"), &mut text).expect("text");
    assert!(status.success() && text.contains("the run in this output is done"), "{text}");
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""));
}
