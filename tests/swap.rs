//! What a swap promises: a stage of a running pipeline is replaced at a barrier, no message is lost or doubled, what does not
//! fit is refused with its reasons, what fails is undone, and a killed run goes on with what was swapped.

use replica_tests::swaps::{begin_swap, go_on, refused, replica, started, stop, swap, swap_said, swapped};
use replica_tests::{Launch, Running, binary, leftovers, said, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};
use serde_json::Value;
use std::process::{Child, Stdio};

/// Enough ticks that the run is still going whenever a test wants something of it; tests that need the end drain it.
const ENDLESS: &str = "ticks = 1000000\npoints = 1000";

fn swaps_of(launch: &Launch) -> Vec<Value> {
    launch.summary()["swaps"].as_array().expect("a list").clone()
}

/// What the sink wrote.
fn lines(launch: &Launch) -> Vec<String> {
    text_lines(launch.read("sink.txt"))
}

fn text_lines(text: Vec<u8>) -> Vec<String> {
    String::from_utf8(text).expect("text").lines().map(str::to_owned).collect()
}

/// The same of an undisturbed run of `n_ticks` ticks.
fn reference(n_ticks: usize, relay: &str) -> Vec<String> {
    text_lines(undisturbed(&format!("ticks = {n_ticks}\npoints = 1000"), relay))
}

/// The sink's lines must be those of undisturbed runs: from each number of ticks on those of a run with that relay.
fn assert_made_by(launch: &Launch, changes: &[(u64, &str)]) {
    let got = lines(launch);
    let mut from = 0;
    for (index, (_, relay)) in changes.iter().enumerate() {
        let until = changes.get(index + 1).map_or(got.len(), |(ticks, _)| 2 * *ticks as usize);
        let expected = reference(got.len() / 2, relay);
        assert!(from < until && until <= got.len(), "{from} to {until} of {} lines by {relay:?}", got.len());
        assert!(got[from..until] == expected[from..until], "lines {from} to {until} are not those of relay {relay:?}");
        from = until;
    }
}

fn ticks_and_changes(swap: &Value) -> (u64, String) {
    (swap["ticks"].as_u64().expect("a number"), swap["changes"].to_string())
}

#[test]
fn a_swap_to_the_same_program_does_not_show_in_the_result() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let before = running.stage("relay");
    let text = swapped(&launch, &["relay"]);
    assert!(text.starts_with("swapped relay at barrier ") && text.contains(" s without output"), "{text}");
    assert_ne!(before, running.stage("relay"), "another process");
    go_on(&launch);
    assert!(stop(&launch).starts_with("drained: "));
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
    let swaps = swaps_of(&launch);
    assert_eq!(swaps.len(), 1);
    assert!(swaps[0]["seconds_without_output"].as_f64() > Some(0.0), "{swaps:?}");
    assert!(swaps[0]["state_bytes"].as_u64() > Some(4), "the relay has a running sum: {swaps:?}");
    assert_eq!(launch.summary()["total"]["restarts"], 0, "a swap is no restart");
    let domain = replica_tests::domain_of(&launch.output());
    assert_eq!(leftovers(&domain), Vec::<String>::new());
}

#[test]
fn a_setting_is_swapped_and_swapped_back_without_loss() {
    let launch = Launch::of_misbehaving("", ENDLESS, "salt = 1");
    let running = started(&launch);
    swapped(&launch, &["relay", "--set", "salt=2"]);
    go_on(&launch);
    swapped(&launch, &["relay", "--unset", "salt"]);
    go_on(&launch);
    swapped(&launch, &["relay", "--back"]);
    go_on(&launch);
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    let swaps: Vec<(u64, String)> = swaps_of(&launch).iter().map(ticks_and_changes).collect();
    let changes: Vec<&str> = swaps.iter().map(|(_, changes)| changes.as_str()).collect();
    assert_eq!(changes, [r#"["relay.salt=2"]"#, r#"["!relay.salt"]"#, r#"["relay back to the launch file"]"#]);
    let [first, second, third] = [swaps[0].0, swaps[1].0, swaps[2].0];
    assert_made_by(&launch, &[(0, "salt = 1"), (first, "salt = 2"), (second, ""), (third, "salt = 1")]);
}

#[test]
fn the_source_and_the_sink_are_swapped_too() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    for stage in ["source", "sink"] {
        swapped(&launch, &[stage]);
        go_on(&launch);
    }
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
}

#[test]
fn what_does_not_fit_is_refused_with_its_reason_and_the_run_goes_on() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let before = ["source", "relay", "sink"].map(|stage| running.stage(stage));
    let sink = binary("misbehaving-sink").display().to_string();
    let cases: [(&[&str], &[&str]); 8] = [
        (&["relai"], &["[relai]: no such stage in this run; did you mean `relay`?"]),
        (&["relay", "--program", "nowhere/relay"], &["program ", "nowhere/relay is not there"]),
        (&["relay", "--program", "/etc/hostname"], &["/etc/hostname cannot be started"]),
        (&["relay", "--program", &sink], &["needs topic class, which no stage of this file produces"]),
        (&["relay", "--set", "salz=3"], &["relay.salz: unknown key; did you mean `salt`?"]),
        (&["relay", "--set", "salt=-3"], &["relay.salt: ", "(from --set)"]),
        (&["relay", "--unset", "salt"], &["there is no relay.salt to leave out"]),
        (&["run"], &["[run]: no such stage in this run"]),
    ];
    for (arguments, words) in cases {
        refused(&launch, arguments, words);
    }
    assert_eq!(before, ["source", "relay", "sink"].map(|stage| running.stage(stage)), "nobody was restarted");
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_made_by(&launch, &[(0, "")]);
    assert_eq!(swaps_of(&launch), Vec::<Value>::new());
}

#[test]
fn a_program_that_fails_at_its_start_or_refuses_the_state_is_taken_back() {
    let launch = Launch::of_misbehaving("restarts = 0", ENDLESS, "");
    let running = started(&launch);
    for (fault, words) in
        [("fault=fails_at_start", "told to fail at the start"), ("fault=takes_up_no_state", "told to take up no state")]
    {
        let output = swap(&launch, &["relay", "--set", fault, "--set", "salt=9"]);
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        for word in [words, "not swapped relay at barrier", "everything is as before: [relay] exit: "] {
            assert!(said(&output).contains(word), "{word:?} is not in:\n{}", said(&output));
        }
        go_on(&launch);
    }
    stop(&launch);
    assert_eq!(running.wait(), Some(3), "that was no restart of the run");
    assert_made_by(&launch, &[(0, "")]);
    let swaps = swaps_of(&launch);
    assert!(swaps.iter().all(|swap| swap["undone"].is_string()) && swaps.len() == 2, "{swaps:?}");
}

/// Begins a swap that cannot come to its barrier, because the sink stands still.
fn begin_stuck_swap(launch: &Launch, running: &Running) -> Child {
    kill_process(running.stage("sink"), Signal::STOP).expect("the sink lives");
    begin_swap(launch, &["relay", "--set", "salt=3"])
}

#[test]
fn a_stage_killed_on_the_way_to_the_barrier_delays_the_swap() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let mut child = begin_stuck_swap(&launch, &running);
    kill_process(running.stage("sink"), Signal::KILL).expect("the sink lives");
    assert!(child.wait().expect("ends").success(), "{}", swap_said(&launch));
    go_on(&launch);
    stop(&launch);
    assert_eq!(running.wait(), Some(3));
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    let ticks = swaps_of(&launch)[0]["ticks"].as_u64().expect("a number");
    assert_made_by(&launch, &[(0, ""), (ticks, "salt = 3")]);
}

#[test]
fn a_stage_killed_at_any_moment_of_a_swap_loses_nothing() {
    for stage in ["source", "relay", "sink"] {
        let launch = Launch::of_misbehaving("", ENDLESS, "");
        let running = started(&launch);
        let old = running.stage(stage);
        let swapping = replica(&launch, &["swap", "relay"]).stderr(Stdio::null()).stdout(Stdio::null()).spawn();
        let new = wait_for("another process", || running.find_stage(stage).filter(|pid| *pid != old));
        // Whether it was before or behind the sink's first tick: the result is the same.
        let _ = kill_process(new, Signal::KILL);
        swapping.expect("replica starts").wait().expect("ends");
        go_on(&launch);
        stop(&launch);
        assert_eq!(running.wait(), Some(3));
        assert_made_by(&launch, &[(0, "")]);
        assert_eq!(swaps_of(&launch).len(), 1);
    }
}

#[test]
fn a_run_killed_after_a_swap_is_resumed_with_it() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    swapped(&launch, &["relay", "--set", "salt=4"]);
    running.signal(Signal::KILL);
    assert_eq!(running.wait(), None);
    let resumed = launch.start_again(&["--resume"]);
    wait_for("the resumed run", || resumed.stderr().contains("resuming from barrier").then_some(()));
    resumed.stage("sink");
    go_on(&launch);
    stop_when_listening(&launch);
    assert_eq!(resumed.wait(), Some(3));
    let swaps = swaps_of(&launch);
    assert_eq!(swaps.len(), 1, "{swaps:?}");
    assert_made_by(&launch, &[(0, ""), (swaps[0]["ticks"].as_u64().expect("a number"), "salt = 4")]);
}

#[test]
fn a_run_killed_before_a_swap_held_is_resumed_without_it() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
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
    // Which of the two it was when the supervisor died, it has written down.
    let record: Value = serde_json::from_slice(&std::fs::read(&record).expect("a file")).expect("JSON");
    let resumed = launch.start_again(&["--resume"]);
    resumed.stage("sink");
    wait_for("the resumed run", || resumed.stderr().contains("resuming from barrier").then_some(()));
    go_on(&launch);
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
fn a_swap_is_refused_while_the_run_is_drained_and_while_another_is_under_way() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    let mut child = begin_stuck_swap(&launch, &running);
    refused(&launch, &["relay"], &["a swap of [relay] is under way"]);
    running.signal(Signal::INT);
    assert!(!child.wait().expect("ends").success());
    assert!(swap_said(&launch).contains("the run is being drained"), "{}", swap_said(&launch));
    refused(&launch, &["relay"], &["the run is being drained"]);
    kill_process(running.stage("sink"), Signal::CONT).expect("the sink lives");
    let errors = launch.folder().join("stderr.txt");
    assert_eq!(running.wait(), Some(3), "{}", std::fs::read_to_string(errors).unwrap_or_default());
    assert_made_by(&launch, &[(0, "")]);
}

#[test]
fn stop_now_does_not_wait_for_what_is_on_the_way() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    let running = started(&launch);
    // A stage that does not move cannot be drained.
    kill_process(running.stage("relay"), Signal::STOP).expect("the stage lives");
    let output = replica(&launch, &["stop", "--now"]).output().expect("replica starts");
    assert!(said(&output).contains("stopping") && String::from_utf8_lossy(&output.stdout).starts_with("stopped: "));
    assert_eq!(running.wait(), Some(1));
    refused_without_run(&launch, "is not alive");
}

fn refused_without_run(launch: &Launch, words: &str) {
    let output = swap(launch, &["relay"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains(words), "{}", said(&output));
}

#[test]
fn a_supervisor_that_hangs_or_is_not_there_is_told_from_one_that_answers() {
    let launch = Launch::of_misbehaving("", ENDLESS, "");
    refused_without_run(&launch, "no run in ");
    let running = started(&launch);
    running.signal(Signal::STOP);
    refused_without_run(&launch, "says nothing for 10 s: it hangs");
    running.signal(Signal::KILL);
    wait_for("its end", || (!replica_tests::is_alive(running.pid())).then_some(()));
    refused_without_run(&launch, "is not alive");
}
