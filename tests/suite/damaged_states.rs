//! State files that a crash, a disk or a user has damaged: `--resume` reports them and continues from the previous
//! barrier, and the result equals an undisturbed run.

use replica_tests::{Launch, gate, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};
use std::path::{Path, PathBuf};

const SOURCE: &str = "ticks = 400\npoints = 5000";
const STAGES: [&str; 3] = ["source", "relay", "sink"];

/// A run that was killed with its supervisor in the middle of the drive.
fn killed() -> Launch {
    let launch = Launch::misbehaving("", SOURCE, &gate(203));
    launch.kill_at_barrier(20, &STAGES);
    launch
}

/// Barriers at which all stages have a state, the newest first.
fn complete_barriers(launch: &Launch) -> Vec<u64> {
    let newest = launch.newest_barrier().expect("a barrier");
    let is_complete = |barrier: &u64| STAGES.iter().all(|stage| state_file(launch, *barrier, stage).is_file());
    (1..=newest).rev().filter(is_complete).collect()
}

fn state_file(launch: &Launch, barrier: u64, stage: &str) -> PathBuf {
    launch.states().join(barrier.to_string()).join(format!("{stage}.state"))
}

/// Resumes and compares. Returns the messages of the supervisor.
fn resumed(launch: &Launch) -> String {
    let mut running = launch.start_again(&["--resume"]);
    let code = wait_for("the end of the run", || running.ended());
    assert_eq!(code, Some(0), "{}", running.stderr());
    assert!(
        launch.read("sink.txt") == undisturbed(SOURCE, ""),
        "the damaged state changed the result: {}",
        running.stderr()
    );
    running.stderr()
}

fn falls_back(stage: &str, damage: fn(&Path), words: &str) {
    let launch = killed();
    let barriers = complete_barriers(&launch);
    assert!(barriers.len() >= 2, "the last two complete barriers are kept: {barriers:?}");
    let path = state_file(&launch, barriers[0], stage);
    damage(&path);
    let output_text = resumed(&launch);
    // The start of the path depends on links.
    let path = format!("run/states/{}/{stage}.state: {words}", barriers[0]);
    assert!(output_text.contains(&format!("barrier {} is skipped: ", barriers[0])), "{output_text}");
    assert!(output_text.contains(&path), "{path} is not in {output_text}");
    assert!(output_text.contains(&format!("resuming from barrier {}\n", barriers[1])), "{output_text}");
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("a state")
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).expect("writes");
}

#[test]
fn truncated_state_is_skipped() {
    falls_back("sink", |path| write(path, &bytes(path)[..40]), "not a whole saved state: 40 bytes");
}

#[test]
fn state_with_a_flipped_bit_is_skipped() {
    let flip = |path: &Path| {
        let mut bytes = bytes(path);
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        write(path, &bytes);
    };
    falls_back("relay", flip, "saved state has checksum");
}

#[test]
fn empty_state_is_skipped() {
    falls_back("source", |path| write(path, &[]), "not a whole saved state: 0 bytes");
}

#[test]
fn missing_state_is_skipped() {
    falls_back("relay", |path| std::fs::remove_file(path).expect("removes"), "cannot be read: ");
}

#[test]
fn run_without_valid_states_restarts_from_the_beginning() {
    let launch = killed();
    for barrier in complete_barriers(&launch) {
        write(&state_file(&launch, barrier, "relay"), b"REPLICAS but no more");
    }
    let output_text = resumed(&launch);
    assert!(output_text.contains("resuming from the beginning\n"), "{output_text}");
    assert!(output_text.matches("is skipped: ").count() >= 2, "{output_text}");
}

/// A state may also be found damaged at a restart, not only when a run is resumed.
#[test]
fn restart_skips_a_damaged_state() {
    let relay = "fault = \"stall\"\nat_tick = 203\nonce = \"struck\"";
    let launch = Launch::misbehaving("", SOURCE, relay);
    let mut running = launch.start();
    wait_for("the stall", || launch.output().join("struck").exists().then_some(()));
    let newest = wait_for("barrier 40", || complete_barriers(&launch).first().copied().filter(|b| *b == 40));
    write(&state_file(&launch, newest, "sink"), &[]);
    kill_process(running.stage("relay"), Signal::KILL).expect("the stage lives");
    let code = wait_for("the end of the run", || running.ended());
    assert_eq!(code, Some(0), "{}", running.stderr());
    assert!(running.stderr().contains("barrier 40 is skipped: "), "{}", running.stderr());
    assert!(running.stderr().contains("restart 1 of 3 from barrier 39 "), "{}", running.stderr());
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "the damaged state changed the result");
}
