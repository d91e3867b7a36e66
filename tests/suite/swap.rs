//! Swaps: a stage of a running pipeline is replaced at a barrier without a lost or duplicated message. An unsuitable
//! swap is refused with its reasons, a failing one is undone, and a killed run resumes with its completed swaps.

use replica_tests::swaps::{
    begin_swap, refused, replica, started, stop, swap, swap_output, swapped, wait_for_two_barriers,
};
use replica_tests::{Launch, Running, binary, leftovers, output_text, undisturbed_lines, wait_for};
use rustix::process::{Signal, kill_process};
use serde_json::Value;
use std::process::{Child, Stdio};

/// More ticks than any test waits for; tests that need the end drain the run.
const ENDLESS: &str = "ticks = 1000000\npoints = 1000";

fn swaps_of(launch: &Launch) -> Vec<Value> {
    launch.summary()["swaps"].as_array().expect("a list").clone()
}

/// The lines that the sink wrote.
fn lines(launch: &Launch) -> Vec<String> {
    String::from_utf8(launch.read("sink.txt")).expect("text").lines().map(str::to_owned).collect()
}

/// Asserts that the sink's lines equal undisturbed runs: from each tick of `changes` on, a run with that relay.
fn assert_made_by(launch: &Launch, changes: &[(u64, &str)]) {
    let got = lines(launch);
    let mut from = 0;
    for (index, (_, relay)) in changes.iter().enumerate() {
        let until = changes.get(index + 1).map_or(got.len(), |(ticks, _)| 2 * *ticks as usize);
        let expected = undisturbed_lines(got.len() / 2, relay);
        assert!(from < until && until <= got.len(), "{from} to {until} of {} lines by {relay:?}", got.len());
        assert!(got[from..until] == expected[from..until], "lines {from} to {until} differ from relay {relay:?}");
        from = until;
    }
}

fn ticks_and_changes(swap: &Value) -> (u64, String) {
    (swap["ticks"].as_u64().expect("a number"), swap["changes"].to_string())
}

#[test]
fn swap_to_the_same_program_does_not_change_the_result() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let before = running.stage("relay");
    let text = swapped(&launch, &["relay"]);
    assert!(text.starts_with("swapped relay at barrier ") && text.contains(" s without output"), "{text}");
    assert_ne!(before, running.stage("relay"), "another process");
    wait_for_two_barriers(&launch);
    assert!(stop(&launch).starts_with("drained: "));
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
    let swaps = swaps_of(&launch);
    assert_eq!(swaps.len(), 1);
    assert!(swaps[0]["seconds_without_output"].as_f64() > Some(0.0), "{swaps:?}");
    assert!(swaps[0]["state_bytes"].as_u64() > Some(4), "the relay has a running sum: {swaps:?}");
    assert_eq!(launch.summary()["total"]["restarts"], 0, "a swap is not a restart");
    let domain = replica_tests::domain_of(&launch.output());
    assert_eq!(leftovers(&domain), Vec::<String>::new());
}

#[test]
fn swapped_setting_applies_from_its_barrier_without_loss() {
    let launch = Launch::misbehaving("", ENDLESS, "salt = 1");
    let running = started(&launch);
    swapped(&launch, &["relay", "--set", "salt=2"]);
    wait_for_two_barriers(&launch);
    swapped(&launch, &["relay", "--unset", "salt"]);
    wait_for_two_barriers(&launch);
    swapped(&launch, &["relay", "--back"]);
    wait_for_two_barriers(&launch);
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    let swaps: Vec<(u64, String)> = swaps_of(&launch).iter().map(ticks_and_changes).collect();
    let changes: Vec<&str> = swaps.iter().map(|(_, changes)| changes.as_str()).collect();
    assert_eq!(
        changes,
        [r#"["--set relay.salt=2"]"#, r#"["--unset relay.salt"]"#, r#"["relay back to the launch file"]"#]
    );
    let [first, second, third] = [swaps[0].0, swaps[1].0, swaps[2].0];
    assert_made_by(&launch, &[(0, "salt = 1"), (first, "salt = 2"), (second, ""), (third, "salt = 1")]);
}

#[test]
fn source_and_sink_can_be_swapped() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    for stage in ["source", "sink"] {
        swapped(&launch, &[stage]);
        wait_for_two_barriers(&launch);
    }
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
}

#[test]
fn unsuitable_swap_is_refused_and_the_run_continues() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let before = ["source", "relay", "sink"].map(|stage| running.stage(stage));
    let sink = binary("misbehaving-sink").display().to_string();
    let cases: [(&[&str], &[&str]); 8] = [
        (&["relai"], &["[relai]: no such stage in this run; did you mean `relay`?"]),
        (&["relay", "--program", "nowhere/relay"], &["program ", "nowhere/relay does not exist"]),
        (&["relay", "--program", "/etc/hostname"], &["/etc/hostname: cannot be started"]),
        (&["relay", "--program", &sink], &["needs topic class, which no stage of this file produces"]),
        (&["relay", "--set", "salz=3"], &["relay.salz: unknown key; did you mean `salt`?"]),
        (&["relay", "--set", "salt=-3"], &["relay.salt: ", "(from --set)"]),
        (&["relay", "--unset", "salt"], &["the launch file does not set relay.salt"]),
        (&["run"], &["[run]: no such stage in this run"]),
    ];
    for (arguments, words) in cases {
        refused(&launch, arguments, words);
    }
    assert_eq!(before, ["source", "relay", "sink"].map(|stage| running.stage(stage)), "no stage was restarted");
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
    assert_eq!(swaps_of(&launch), Vec::<Value>::new());
}

#[test]
fn failing_program_is_swapped_back() {
    let launch = Launch::misbehaving("restarts = 0", ENDLESS, "");
    let running = started(&launch);
    for (fault, words) in [
        ("fault=fails_at_start", "configured to fail at the start"),
        ("fault=loads_no_state", "configured to load no state"),
    ] {
        let output = swap(&launch, &["relay", "--set", fault, "--set", "salt=9"]);
        assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
        for word in [words, "not swapped relay at barrier", "the swap was undone: [relay] exit: "] {
            assert!(output_text(&output).contains(word), "{word:?} is not in:\n{}", output_text(&output));
        }
        wait_for_two_barriers(&launch);
    }
    stop(&launch);
    assert_eq!(running.wait(), Some(3), "the run was not restarted");
    assert_made_by(&launch, &[(0, "")]);
    let swaps = swaps_of(&launch);
    assert!(swaps.iter().all(|swap| swap["undone"].is_string()) && swaps.len() == 2, "{swaps:?}");
}

/// Starts a swap that cannot reach its barrier, because the sink is stopped.
fn begin_stuck_swap(launch: &Launch, running: &Running) -> Child {
    kill_process(running.stage("sink"), Signal::STOP).expect("the sink lives");
    begin_swap(launch, &["relay", "--set", "salt=3"])
}

#[test]
fn stage_killed_before_the_barrier_delays_the_swap() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let mut child = begin_stuck_swap(&launch, &running);
    kill_process(running.stage("sink"), Signal::KILL).expect("the sink lives");
    assert!(child.wait().expect("ends").success(), "{}", swap_output(&launch));
    wait_for_two_barriers(&launch);
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    let ticks = swaps_of(&launch)[0]["ticks"].as_u64().expect("a number");
    assert_made_by(&launch, &[(0, ""), (ticks, "salt = 3")]);
}

#[test]
fn stages_killed_during_a_swap_lose_nothing() {
    for stage in ["source", "relay", "sink"] {
        let launch = Launch::misbehaving("", ENDLESS, "");
        let running = started(&launch);
        let old = running.stage(stage);
        let swapping = replica(&launch, &["swap", "relay"]).stderr(Stdio::null()).stdout(Stdio::null()).spawn();
        let new = wait_for("another process", || running.find_stage(stage).filter(|pid| *pid != old));
        // Before or after the sink's first tick: the result is the same.
        let _ = kill_process(new, Signal::KILL);
        swapping.expect("replica starts").wait().expect("ends");
        wait_for_two_barriers(&launch);
        stop(&launch);
        assert_eq!(running.wait(), Some(3));
        assert_made_by(&launch, &[(0, "")]);
        assert_eq!(swaps_of(&launch).len(), 1);
    }
}

#[test]
fn run_killed_after_a_swap_resumes_with_it() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    swapped(&launch, &["relay", "--set", "salt=4"]);
    running.signal(Signal::KILL);
    assert_eq!(running.wait(), None);
    let resumed = launch.start_again(&["--resume"]);
    wait_for("the resumed run", || resumed.stderr().contains("resuming from barrier").then_some(()));
    resumed.stage("sink");
    wait_for_two_barriers(&launch);
    stop_when_listening(&launch);
    assert_eq!(resumed.wait(), Some(3));
    let swaps = swaps_of(&launch);
    assert_eq!(swaps.len(), 1, "{swaps:?}");
    assert_made_by(&launch, &[(0, ""), (swaps[0]["ticks"].as_u64().expect("a number"), "salt = 4")]);
}

#[test]
fn run_killed_during_a_swap_resumes_without_it() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let record = launch.output().join("run/swaps.json");
    let swapping = replica(&launch, &["swap", "relay", "--set", "salt=4"]).stderr(Stdio::null()).spawn();
    wait_for("the attempt", || {
        let record: Value = serde_json::from_slice(&std::fs::read(&record).ok()?).ok()?;
        (record["trying"].is_object() || !record["swaps"].as_array()?.is_empty()).then_some(())
    });
    running.signal(Signal::KILL);
    assert_eq!(running.wait(), None);
    swapping.expect("replica starts").wait().expect("ends");
    // The supervisor had recorded which of the two applied when it was killed.
    let record: Value = serde_json::from_slice(&std::fs::read(&record).expect("a file")).expect("JSON");
    let resumed = launch.start_again(&["--resume"]);
    resumed.stage("sink");
    wait_for("the resumed run", || resumed.stderr().contains("resuming from barrier").then_some(()));
    wait_for_two_barriers(&launch);
    stop_when_listening(&launch);
    assert_eq!(resumed.wait(), Some(3));
    match record["swaps"].as_array().and_then(|swaps| swaps.first()) {
        None => assert_made_by(&launch, &[(0, "")]),
        Some(swap) => assert_made_by(&launch, &[(0, ""), (swap["ticks"].as_u64().expect("a number"), "salt = 4")]),
    }
}

fn stop_when_listening(launch: &Launch) {
    wait_for("a supervisor that listens", || {
        replica(launch, &["stop"]).output().expect("replica starts").status.success().then_some(())
    });
}

#[test]
fn swap_is_refused_while_draining_or_during_another_swap() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let mut child = begin_stuck_swap(&launch, &running);
    refused(&launch, &["relay"], &["a swap of [relay] is in progress"]);
    running.signal(Signal::INT);
    assert!(!child.wait().expect("ends").success());
    assert!(swap_output(&launch).contains("the run is draining"), "{}", swap_output(&launch));
    refused(&launch, &["relay"], &["the run is draining"]);
    kill_process(running.stage("sink"), Signal::CONT).expect("the sink lives");
    let errors = launch.folder().join("stderr.txt");
    assert_eq!(running.wait(), Some(3), "{}", std::fs::read_to_string(errors).unwrap_or_default());
    assert_made_by(&launch, &[(0, "")]);
}

#[test]
fn stop_now_does_not_wait_for_in_flight_data() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    let running = started(&launch);
    // A stopped stage cannot be drained.
    kill_process(running.stage("relay"), Signal::STOP).expect("the stage lives");
    let output = replica(&launch, &["stop", "--now"]).output().expect("replica starts");
    assert!(
        output_text(&output).contains("stopping") && String::from_utf8_lossy(&output.stdout).starts_with("stopped: ")
    );
    assert_eq!(running.wait(), Some(1));
    refused_without_run(&launch, "is not alive");
}

fn refused_without_run(launch: &Launch, words: &str) {
    let output = swap(launch, &["relay"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output_text(&output).contains(words), "{}", output_text(&output));
}

#[test]
fn hung_supervisor_is_distinguished_from_an_absent_one() {
    let launch = Launch::misbehaving("", ENDLESS, "");
    refused_without_run(&launch, "no run in ");
    let running = started(&launch);
    running.signal(Signal::STOP);
    refused_without_run(&launch, "has sent nothing for 10 s: it hangs");
    running.signal(Signal::KILL);
    wait_for("its end", || (!replica_tests::is_alive(running.pid())).then_some(()));
    refused_without_run(&launch, "is not alive");
}
