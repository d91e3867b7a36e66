//! Recording and replay: a recording is complete whatever happens to the processes, does not change the result of the
//! run, and its replay gives the same result.

use replica_tests::{
    Launch, RECORDED_VICTIMS, Random, Running, binary, drive, gate, kill_while_recording, long_drive, output_text,
    pipeline, result_files, undisturbed, wait_for,
};
use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const SOURCE: &str = "ticks = 60\npoints = 500";

fn replica(arguments: &[&str], files: &[&Path]) -> Output {
    Command::new(binary("replica")).args(arguments).args(files).output().expect("starts")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A run of the small pipeline with a recorder, and the recording.
fn recorded(launch: Launch, topics: &str) -> (Launch, PathBuf) {
    let file = launch.folder().join("recorded.mcap");
    let launch = launch.with("--record").with(text(&file)).with("--topics").with(topics);
    (launch, file)
}

fn succeeded(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", output_text(output));
}

fn same_bytes(a: &Path, b: &Path) {
    let compared = replica(&["compare"], &[a, b]);
    assert_eq!(compared.status.code(), Some(0), "{}", String::from_utf8_lossy(&compared.stdout));
    assert!(std::fs::read(a).expect("there") == std::fs::read(b).expect("there"), "equal, but not to the byte");
}

#[test]
fn recordings_of_equal_runs_are_equal_and_do_not_change_the_result() {
    let (one, a) = recorded(Launch::misbehaving("", SOURCE, ""), "sweep,class");
    let (other, b) = recorded(Launch::misbehaving("", SOURCE, ""), "class,sweep");
    succeeded(&one.run());
    succeeded(&other.run());
    assert!(one.read("sink.txt") == undisturbed(SOURCE, ""), "the recording changed the result");
    same_bytes(&a, &b);
    let inspected = replica(&["inspect"], &[&a]);
    succeeded(&inspected);
    let table = String::from_utf8_lossy(&inspected.stdout).into_owned();
    assert!(table.contains("class") && table.contains("60, to the end"), "{table}");
}

#[test]
fn recording_continues_across_restarts() {
    let (calm, expected) = recorded(Launch::misbehaving("", SOURCE, ""), "sweep,class");
    succeeded(&calm.run());
    for fault in ["error", "panic"] {
        let relay = format!("fault = \"{fault}\"\nat_tick = 23\nonce = \"struck\"");
        let (launch, file) = recorded(Launch::misbehaving("", SOURCE, &relay), "sweep,class");
        let output = launch.run();
        succeeded(&output);
        assert_eq!(launch.summary()["total"]["restarts"], 1, "{}", output_text(&output));
        let compared = replica(&["compare"], &[&expected, &file]);
        assert_eq!(compared.status.code(), Some(0), "{}", String::from_utf8_lossy(&compared.stdout));
    }
}

fn recorder_of(running: &Running) -> Pid {
    wait_for("the recorder", || {
        replica_tests::processes_of(running.pid().as_raw_nonzero().get().unsigned_abs()).into_iter().find(|pid| {
            let line = std::fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
            String::from_utf8_lossy(&line).split('\0').nth(1) == Some("record")
        })
    })
}

/// Runs a pipeline with a gate; each stage is killed at its barrier.
fn survives_kills(launch: &Launch, kills: &[(&str, u64)]) {
    let running = launch.start();
    for (stage, barrier) in kills {
        launch.wait_for_barrier(*barrier);
        running.kill_stage(stage);
    }
    launch.open_gate();
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    assert_eq!(launch.summary()["total"]["restarts"], kills.len(), "{}", launch.stderr());
}

#[test]
fn killed_stages_do_not_change_the_recording() {
    let source = "ticks = 400\npoints = 20000";
    let (calm, expected) = recorded(Launch::misbehaving("", source, ""), "sweep,class");
    succeeded(&calm.run());
    let (launch, file) = recorded(Launch::misbehaving("restarts = 9", source, &gate(399)), "sweep,class");
    survives_kills(&launch, &[("source", 5), ("relay", 20), ("sink", 40)]);
    let compared = replica(&["compare"], &[&expected, &file]);
    assert_eq!(compared.status.code(), Some(0), "{}", String::from_utf8_lossy(&compared.stdout));
}

#[test]
fn run_continues_without_its_recorder() {
    let source = "ticks = 400\npoints = 20000";
    let (launch, file) = recorded(Launch::misbehaving("", source, &gate(399)), "sweep,class");
    let running = launch.start();
    let recorder = recorder_of(&running);
    launch.wait_for_barrier(10);
    kill_process(recorder, Signal::KILL).expect("it lives");
    wait_for("its report", || running.stderr().contains("the run continues without it").then_some(()));
    launch.open_gate();
    assert_eq!(running.wait(), Some(3), "done, but the recording is not");
    assert!(launch.read("sink.txt") == undisturbed(source, ""), "the killed recorder changed the result");
    let inspected = replica(&["inspect"], &[&file]);
    assert_eq!(inspected.status.code(), Some(3), "{}", output_text(&inspected));
    assert!(String::from_utf8_lossy(&inspected.stdout).contains("recorded.mcap: cut at byte"));
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn killed_process_leaves_a_complete_recording_or_one_that_says_that_it_is_not() {
    // One kill of each: a stage must leave the recording complete, the other processes need not.
    let kills = kill_while_recording(&long_drive(), RECORDED_VICTIMS.len(), &mut Random::new(6));
    println!("{kills:?}");
    assert_eq!(kills.struck.len(), RECORDED_VICTIMS.len());
    assert!(kills.complete >= 3, "{kills:?}");
}

#[test]
fn unknown_topics_are_not_recorded() {
    let (launch, _) = recorded(Launch::misbehaving("", SOURCE, ""), "sweep,submap");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(78), "{}", output_text(&output));
    assert!(output_text(&output).contains("no stage of this run produces topic submap"), "{}", output_text(&output));
}

#[test]
fn compare_reports_where_recordings_differ() {
    let (one, a) = recorded(Launch::misbehaving("", "ticks = 9\npoints = 5", ""), "sweep,class");
    let (other, b) = recorded(Launch::misbehaving("", "ticks = 8\npoints = 5", ""), "sweep");
    succeeded(&one.run());
    succeeded(&other.run());
    let compared = replica(&["compare"], &[&a, &b]);
    let table = String::from_utf8_lossy(&compared.stdout).into_owned();
    assert_eq!(compared.status.code(), Some(3), "{table}");
    for words in [
        "class: only in a",
        "sweep: 8 messages in both, 0 differ",
        "1 messages only in a, the first is 8",
        "sweep.tick: 8 messages in both, 8 differ",
        "first: message 0 (stamp 0, tick 0) row 0 progress: 0.111",
        "end                    1  1",
    ] {
        assert!(table.contains(words), "{words:?} is not in\n{table}");
    }
    assert_eq!(replica(&["compare", "--topics", "cube"], &[&a, &b]).status.code(), Some(1));
}

/// The recording's sweeps through relay and sink.
fn replayed(recording: &Path, run: &str, relay: &str) -> Launch {
    Launch::misbehaving(run, SOURCE, relay)
        .with("--source")
        .with("replay")
        .with("--set")
        .with(&format!("replay.recording={}", recording.display()))
}

#[test]
fn replay_reproduces_the_run_despite_killed_stages() {
    let (original, file) = recorded(Launch::misbehaving("", "ticks = 400\npoints = 20000", ""), "sweep");
    succeeded(&original.run());
    let launch = replayed(&file, "", "");
    let output = launch.run();
    succeeded(&output);
    assert!(output_text(&output).contains("left out: source"), "{}", output_text(&output));
    assert!(launch.read("sink.txt") == original.read("sink.txt"), "the replay changed the result");

    let launch = replayed(&file, "restarts = 9", &gate(399));
    survives_kills(&launch, &[("relay", 5), ("replay", 20), ("sink", 40)]);
    assert!(launch.read("sink.txt") == original.read("sink.txt"), "the killed stages changed the result");
}

#[test]
fn replay_command_keeps_its_speed() {
    let (original, file) = recorded(Launch::misbehaving("", "ticks = 12\npoints = 5", ""), "sweep");
    succeeded(&original.run());
    let launch = Launch::misbehaving("", "", "");
    let launch_file = launch.folder().join("launch.toml");
    let output = replica(&["replay", "--speed", "2", "--launch", text(&launch_file)], &[&file]);
    succeeded(&output);
    assert!(launch.read("sink.txt") == original.read("sink.txt"));
    // 11 tenths of a second at twice the speed take at least this long on any machine.
    assert!(launch.summary()["total"]["wall_s"].as_f64() > Some(0.5), "{}", launch.summary());
}

#[test]
fn real_stages_on_a_recording_reproduce_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = || pipeline(&drive(), "", "");
    let topics = "submap,trajectory,placement,color,spectra";
    let (launch, recording) = recorded(file(), &format!("{topics},class"));
    succeeded(&launch.run());

    // A stage alone: byte for byte its output in the run.
    let classes = folder.path().join("class.mcap");
    let alone = Command::new(binary("replica-infer"))
        .args(["run", "--launch", text(&launch.folder().join("launch.toml")), "--recording"])
        .arg(&recording)
        .arg("--record")
        .arg(&classes)
        .output()
        .expect("starts");
    succeeded(&alone);
    let compared = replica(&["compare", "--topics", "class"], &[&recording, &classes]);
    assert_eq!(compared.status.code(), Some(0), "{}", String::from_utf8_lossy(&compared.stdout));

    // infer, instance and export on the other recorded topics: the files of the run.
    let replay = file();
    let launch_file = replay.folder().join("launch.toml");
    let output = replica(&["replay", "--topics", topics, "--launch", text(&launch_file)], &[&recording]);
    succeeded(&output);
    assert!(
        output_text(&output).contains("left out: acquire, slam_aggregate, colorize, calibrate"),
        "{}",
        output_text(&output)
    );
    let expected = result_files(&launch.output());
    let got = result_files(&replay.output());
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>());
    for (name, bytes) in &expected {
        assert!(*bytes == got[name], "{name} differs");
    }
}
