//! What the supervisor promises about stages that fail: exit, hang and stall are told apart and reported with the stage's
//! last words; the run goes on from the last barrier, within a bound, and its result is that of an undisturbed run.

use replica_tests::{Launch, gate, said, seconds_told, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};

const SOURCE: &str = "ticks = 60\npoints = 500";

/// Runs with a fault that strikes once; the result must not show it, and the report, which it returns, must hold `words`.
fn strikes_once(run: &str, fault: &str, words: &[&str]) -> String {
    let relay = format!("fault = \"{fault}\"\nat_tick = 23\nonce = \"struck\"");
    let launch = Launch::of_misbehaving(run, SOURCE, &relay);
    let output = launch.run();
    let text = said(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for word in words {
        assert!(text.contains(word), "{word:?} is not in:\n{text}");
    }
    assert!(launch.output().join("struck").exists(), "the fault has struck");
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    assert_eq!(launch.stage_summary("relay")["faults"], 1);
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "the result shows that {fault} has struck");
    text
}

#[test]
fn a_stage_that_fails_is_restarted_from_the_last_barrier() {
    strikes_once("", "error", &["[relay] exit: ended with exit code 1", "told to fail in tick 23", "from barrier 4"]);
}

#[test]
fn a_stage_that_panics_is_restarted() {
    strikes_once("", "panic", &["[relay] exit: panicked (exit code 101)", "told to panic in tick 23"]);
}

#[test]
fn a_stage_that_leaves_early_is_not_taken_for_done() {
    strikes_once("", "exit", &["[relay] exit: ended with exit code 0 before its work was done"]);
}

#[test]
fn a_stage_that_hangs_is_killed_and_restarted() {
    let words = "[relay] hang: no heartbeat for ";
    let report = strikes_once("hang_s = 10.0", "hang", &[words]);
    assert!(seconds_told(&report, words) >= 10.0, "{report}");
}

#[test]
fn a_stage_that_stalls_is_told_from_one_that_hangs() {
    let report = strikes_once("stall_s = 10.0", "stall", &[" s in the step of tick 23"]);
    assert!(seconds_told(&report, "[relay] stall: ") >= 10.0, "{report}");
}

#[test]
fn restarts_are_bounded() {
    let launch = Launch::of_misbehaving("restarts = 2", SOURCE, "fault = \"error\"\nat_tick = 23");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert_eq!(said(&output).matches("told to fail in tick 23").count(), 3, "{}", said(&output));
    assert_eq!(launch.summary()["outcome"], "failed");
    assert_eq!(launch.summary()["total"]["restarts"], 2);
    assert_eq!(launch.summary()["faults"].as_array().map(Vec::len), Some(3));
}

#[test]
fn ctrl_c_drains_and_finishes_the_files() {
    let launch = Launch::of_misbehaving("", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3), "done, but not complete");
    assert_eq!(launch.summary()["outcome"], "drained");
    let text = String::from_utf8(launch.read("sink.txt")).expect("text");
    let ticks = launch.stage_summary("source")["ticks"].as_u64().expect("a number");
    assert_eq!(text.lines().count() as u64, 2 * ticks, "everything on the way was finished");
}

#[test]
fn a_second_ctrl_c_stops_at_once() {
    let launch = Launch::of_misbehaving("", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    let relay = running.stage("relay");
    // A stage that does not move cannot be drained.
    kill_process(relay, Signal::STOP).expect("the stage lives");
    running.signal(Signal::INT);
    wait_for("the drain", || running.stderr().contains("draining").then_some(()));
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(1));
    assert_eq!(launch.summary()["outcome"], "stopped");
    assert!(!replica_tests::is_alive(relay));
}

#[test]
fn kills_in_the_middle_of_the_drive_leave_the_result_as_it_is() {
    let source = "ticks = 400\npoints = 20000";
    let expected = undisturbed(source, "");
    for (stage, barriers) in [("source", [2, 31]), ("relay", [11, 47]), ("sink", [23, 60])] {
        let launch = Launch::of_misbehaving("restarts = 9", source, &gate(399));
        let running = launch.start();
        for barrier in barriers {
            launch.wait_for_barrier(barrier);
            running.kill_stage(stage);
        }
        launch.open_gate();
        assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
        assert!(launch.read("sink.txt") == expected, "the result shows that {stage} was killed");
        assert_eq!(launch.summary()["total"]["restarts"], 2, "{stage}: {}", launch.stderr());
    }
}

#[test]
fn a_run_whose_supervisor_was_killed_is_resumed() {
    let source = "ticks = 400\npoints = 20000";
    let launch = Launch::of_misbehaving("", source, &gate(399));
    for barrier in [9, 40] {
        let running = if barrier == 9 { launch.start() } else { launch.start_again(&["--resume"]) };
        launch.wait_for_barrier(barrier);
        running.signal(Signal::KILL);
        assert_eq!(running.wait(), None, "SIGKILL leaves no exit code");
        assert!(!launch.output().join("summary.json").exists());
    }
    let other = launch.start_again(&["--resume", "--set", "source.points=3"]);
    assert_eq!(other.wait(), Some(1), "another run's states are not taken up");
    launch.open_gate();
    let resumed = launch.start_again(&["--resume"]);
    assert_eq!(resumed.wait(), Some(0), "{}", launch.stderr());
    assert!(launch.read("sink.txt") == undisturbed(source, ""), "the result shows that the supervisor was killed");
}

#[test]
fn a_stages_own_limit_counts_for_it() {
    // The relay stalls for ever, but its table says that it may take long; the source and the sink merely wait for it.
    let relay = "fault = \"stall\"\nat_tick = 23\nonce = \"struck\"\nstall_s = 12.0";
    let launch = Launch::of_misbehaving("stall_s = 10.0", SOURCE, relay);
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let said = said(&output);
    assert!(seconds_told(&said, "[relay] stall: ") >= 12.0, "{said}");
    assert_eq!(launch.stage_summary("relay")["faults"], 1, "who waits for it is not to blame: {said}");
    assert_eq!(launch.summary()["total"]["restarts"], 1, "{said}");
}

#[test]
fn any_stage_killed_at_its_start_leaves_the_result_as_it_is() {
    let expected = undisturbed(SOURCE, "");
    for stage in ["source", "relay", "sink"] {
        let launch = Launch::of_misbehaving("", SOURCE, "fault = \"waits_at_start\"\nonce = \"../gate\"");
        let running = launch.start();
        running.kill_stage(stage);
        launch.open_gate();
        assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
        assert!(launch.read("sink.txt") == expected, "the result shows that {stage} was killed");
        assert_eq!(launch.summary()["total"]["restarts"], 1, "{stage}: {}", launch.stderr());
    }
}

#[test]
fn a_stage_that_was_stopped_for_a_while_goes_on() {
    // SIGCONT once broke off the sleep of a stage with an error, and so cost a restart.
    let launch = Launch::of_misbehaving("restarts = 0", "ticks = 1000000\npoints = 1000", "");
    let running = launch.start();
    launch.wait_for_barrier(1);
    let [relay, sink] = ["relay", "sink"].map(|stage| running.stage(stage));
    for barrier in 3..13 {
        // Who stands still keeps the other one asleep.
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
