//! Failing stages: exit, hang and stall are distinguished and reported with the last log lines of the stage. The run
//! continues from the last barrier, a limited number of times, and its result equals an undisturbed run.

use replica_tests::{Launch, gate, output_text, reported_seconds, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::process::{Child, Command};

const SOURCE: &str = "ticks = 60\npoints = 500";

/// Runs with a fault that occurs once. It must not change the result, and the report, which is returned, must contain `words`.
fn recovers_once(run: &str, fault: &str, words: &[&str]) -> String {
    let relay = format!("fault = \"{fault}\"\nat_tick = 23\nonce = \"struck\"");
    let launch = Launch::misbehaving(run, SOURCE, &relay);
    let output = launch.run();
    let text = output_text(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for word in words {
        assert!(text.contains(word), "{word:?} is not in:\n{text}");
    }
    assert!(launch.output().join("struck").exists(), "the fault has occurred");
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    assert_eq!(launch.stage_summary("relay")["faults"], 1);
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "{fault} changed the result");
    text
}

#[test]
fn failed_stage_restarts_from_the_last_barrier() {
    recovers_once(
        "",
        "error",
        &["[relay] exit: ended with exit code 1", "configured to fail in tick 23", "from barrier 4"],
    );
}

#[test]
fn panicked_stage_is_restarted() {
    recovers_once("", "panic", &["[relay] exit: panicked (exit code 101)", "configured to panic in tick 23"]);
}

#[test]
fn early_exit_with_code_0_is_a_fault() {
    recovers_once("", "exit", &["[relay] exit: ended with exit code 0 before its work was done"]);
}

#[test]
fn hung_stage_is_killed_and_restarted() {
    let words = "[relay] hang: no heartbeat for ";
    let report = recovers_once("hang_s = 10.0", "hang", &[words]);
    assert!(reported_seconds(&report, words) >= 10.0, "{report}");
}

/// The run and seven endless loops share one processor: a step of 2 s takes about 16 s.
#[test]
#[ignore = "long: .ci/run --nightly"]
fn healthy_stage_without_a_processor_is_not_killed() {
    let first = |set: CpuSet| (0..CpuSet::MAX_CPU).find(|processor| set.is_set(*processor)).expect("a processor");
    let mut one = CpuSet::new();
    one.set(first(sched_getaffinity(None).expect("the own processors")));
    // Processes that this thread starts inherit it.
    sched_setaffinity(None, &one).expect("one of the own processors");
    let launch = Launch::misbehaving("hang_s = 5.0\nstall_s = 6.0", SOURCE, "fault = \"works\"\nat_tick = 23");
    let loops: Vec<_> = (0..7).map(|_| EndlessLoop::start()).collect();
    let running = launch.start();
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    drop(loops);
    assert_eq!(launch.summary()["total"]["restarts"], 0, "{}", launch.stderr());
    assert!(launch.stderr().contains("[relay] has waited"), "{}", launch.stderr());
}

/// A process that uses a processor until it is dropped.
struct EndlessLoop(Child);

impl EndlessLoop {
    fn start() -> Self {
        Self(Command::new("sh").args(["-c", "while :; do :; done"]).spawn().expect("a shell"))
    }
}

impl Drop for EndlessLoop {
    fn drop(&mut self) {
        self.0.kill().and_then(|()| self.0.wait()).expect("killed");
    }
}

#[test]
fn stalled_stage_is_distinguished_from_a_hung_one() {
    let report = recovers_once("stall_s = 10.0", "stall", &[" s in the step of tick 23"]);
    assert!(reported_seconds(&report, "[relay] stall: ") >= 10.0, "{report}");
}

#[test]
fn doubted_result_ends_with_exit_code_3_after_a_restart_too() {
    let relay = "doubt_at_tick = 5\nfault = \"error\"\nat_tick = 43\nonce = \"struck\"";
    let launch = Launch::misbehaving("", SOURCE, relay);
    let output = launch.run();
    let text = output_text(&output);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert_eq!(text.matches("[relay] doubt: 50 % of the rows are invented (limit 0 %)").count(), 1, "{text}");
    assert_eq!(launch.summary()["total"]["restarts"], 1, "{text}");
    assert_eq!(launch.stage_summary("relay")["doubts"][0]["name"], "rows_invented");
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "a doubt changes no result");
}

#[test]
fn restarts_are_limited() {
    let launch = Launch::misbehaving("restarts = 2", SOURCE, "fault = \"error\"\nat_tick = 23");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    assert_eq!(output_text(&output).matches("configured to fail in tick 23").count(), 3, "{}", output_text(&output));
    assert_eq!(launch.summary()["outcome"], "failed");
    assert_eq!(launch.summary()["total"]["restarts"], 2);
    assert_eq!(launch.summary()["faults"].as_array().map(Vec::len), Some(3));
}

#[test]
fn ctrl_c_drains_the_run_and_finishes_the_files() {
    let launch = Launch::misbehaving("", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3), "done, but not complete");
    assert_eq!(launch.summary()["outcome"], "drained");
    let text = String::from_utf8(launch.read("sink.txt")).expect("text");
    let ticks = launch.stage_summary("source")["ticks"].as_u64().expect("a number");
    assert_eq!(text.lines().count() as u64, 2 * ticks, "all in-flight data was processed");
}

#[test]
fn second_ctrl_c_stops_the_run_at_once() {
    let launch = Launch::misbehaving("", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    let relay = running.stage("relay");
    // A stopped stage cannot be drained.
    kill_process(relay, Signal::STOP).expect("the stage lives");
    running.signal(Signal::INT);
    wait_for("the drain", || running.stderr().contains("draining").then_some(()));
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(1));
    assert_eq!(launch.summary()["outcome"], "stopped");
    assert!(!replica_tests::is_alive(relay));
}

#[test]
fn stages_killed_mid_drive_do_not_change_the_result() {
    let source = "ticks = 400\npoints = 20000";
    let expected = undisturbed(source, "");
    for (stage, barriers) in [("source", [2, 31]), ("relay", [11, 47]), ("sink", [23, 60])] {
        let launch = Launch::misbehaving("restarts = 9", source, &gate(399));
        let running = launch.start();
        for barrier in barriers {
            launch.wait_for_barrier(barrier);
            running.kill_stage(stage);
        }
        launch.open_gate();
        assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
        assert!(launch.read("sink.txt") == expected, "the kill of {stage} changed the result");
        assert_eq!(launch.summary()["total"]["restarts"], 2, "{stage}: {}", launch.stderr());
    }
}

#[test]
fn run_of_a_killed_supervisor_is_resumed() {
    let source = "ticks = 400\npoints = 20000";
    let launch = Launch::misbehaving("", source, &gate(399));
    for barrier in [9, 40] {
        let running = if barrier == 9 { launch.start() } else { launch.start_again(&["--resume"]) };
        launch.wait_for_barrier(barrier);
        running.signal(Signal::KILL);
        assert_eq!(running.wait(), None, "SIGKILL leaves no exit code");
        assert!(!launch.output().join("summary.json").exists());
    }
    let other = launch.start_again(&["--resume", "--set", "source.points=3"]);
    assert_eq!(other.wait(), Some(78), "states of another run are refused");
    launch.open_gate();
    let resumed = launch.start_again(&["--resume"]);
    assert_eq!(resumed.wait(), Some(0), "{}", launch.stderr());
    assert!(launch.read("sink.txt") == undisturbed(source, ""), "the kill of the supervisor changed the result");
}

#[test]
fn stall_limit_of_the_stage_replaces_that_of_the_run() {
    // The relay stalls forever, but its table allows more time; the source and the sink only wait for it.
    let relay = "fault = \"stall\"\nat_tick = 23\nonce = \"struck\"\nstall_s = 12.0";
    let launch = Launch::misbehaving("stall_s = 10.0", SOURCE, relay);
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let output_text = output_text(&output);
    assert!(reported_seconds(&output_text, "[relay] stall: ") >= 12.0, "{output_text}");
    assert_eq!(launch.stage_summary("relay")["faults"], 1, "waiting stages are not to blame: {output_text}");
    assert_eq!(launch.summary()["total"]["restarts"], 1, "{output_text}");
}

#[test]
fn stages_killed_at_their_start_do_not_change_the_result() {
    let expected = undisturbed(SOURCE, "");
    for stage in ["source", "relay", "sink"] {
        let launch = Launch::misbehaving("", SOURCE, "fault = \"waits_at_start\"\nonce = \"../gate\"");
        let running = launch.start();
        running.kill_stage(stage);
        launch.open_gate();
        assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
        assert!(launch.read("sink.txt") == expected, "the kill of {stage} changed the result");
        assert_eq!(launch.summary()["total"]["restarts"], 1, "{stage}: {}", launch.stderr());
    }
}

#[test]
fn stage_stopped_for_a_while_continues() {
    // Regression: SIGCONT once interrupted the sleep of a stage with an error, which caused a restart.
    let launch = Launch::misbehaving("restarts = 0", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    let [relay, sink] = ["relay", "sink"].map(|stage| running.stage(stage));
    for barrier in 3..13 {
        // Each of them, stopped, keeps the other one waiting.
        for pid in [relay, sink] {
            kill_process(pid, Signal::STOP).expect("the stage lives");
        }
        for pid in [relay, sink] {
            kill_process(pid, Signal::CONT).expect("the stage lives");
        }
        launch.wait_for_barrier(barrier);
    }
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3));
}
