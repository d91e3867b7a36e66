//! Live mode: no stage waits for another one, the oldest message of a full queue is dropped and counted, and a failed stage
//! restarts alone while the others continue.

use replica_tests::{Launch, Running, leftovers, wait_for};
use rustix::process::{Pid, Signal, kill_process};

/// A sensor without end: a sweep every two milliseconds, so that a stop of some tens of ms overruns every queue.
const SENSOR: &str = "ticks = 1000000\npoints = 500\npace_ms = 2";

fn live(run: &str) -> Launch {
    Launch::misbehaving(&format!("mode = \"live\"\n{run}"), SENSOR, "")
}

/// Requests the end and checks it.
fn end(launch: &Launch, running: Running, code: i32) {
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(code), "{}", launch.stderr());
    assert_eq!(launch.summary()["outcome"], "done");
}

/// Numbers of a topic's messages in the order in which the sink wrote them.
fn seqs(launch: &Launch, topic: &str) -> Vec<u64> {
    let text = String::from_utf8(launch.read("sink.txt")).expect("text");
    let lines = text.lines().filter_map(|line| line.strip_prefix(topic));
    lines.map(|line| line.split_whitespace().next().expect("a number").parse().expect("a number")).collect()
}

fn rises(seqs: &[u64]) -> bool {
    seqs.windows(2).all(|pair| pair[0] < pair[1])
}

#[test]
fn stopped_stage_blocks_no_other_and_its_dropped_messages_are_counted() {
    let launch = live("");
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 2);
    let relay = running.stage("relay");
    kill_process(relay, Signal::STOP).expect("the stage lives");
    let stopped_at = launch.newest_barrier().unwrap_or_default();
    // Twenty barriers are a hundred sweeps: far more than any queue holds.
    launch.wait_for_barrier_of("source", stopped_at + 20);
    kill_process(relay, Signal::CONT).expect("the stage lives");
    let after = launch.newest_barrier().unwrap_or_default();
    launch.wait_for_barrier_of("relay", after + 2);
    end(&launch, running, 3);

    let dropped = launch.stage_summary("relay")["inputs"]["sweep"]["dropped"].as_u64().expect("a number");
    assert!(dropped >= 50, "{dropped} sweeps were dropped");
    assert!(launch.summary()["total"]["dropped"]["sweep"].as_u64() >= Some(dropped));
    assert_eq!(launch.summary()["total"]["restarts"], 0, "{}", launch.stderr());
    let sweeps = seqs(&launch, "sweep");
    let classes = seqs(&launch, "class");
    assert!(rises(&sweeps) && rises(&classes));
    let gap = classes.windows(2).map(|pair| pair[1] - pair[0]).max().expect("classes");
    assert!(gap >= 50, "after the stop the relay continued with the newest message: largest gap {gap}");
}

#[test]
fn killed_stage_restarts_alone() {
    for stage in ["source", "relay", "sink"] {
        let launch = live("");
        let running = launch.start();
        launch.wait_for_barrier_of("sink", 2);
        let before = ["source", "relay", "sink"].map(|name| running.stage(name));
        kill_process(running.stage(stage), Signal::KILL).expect("the stage lives");
        let successor = wait_for("the successor", || running.find_stage(stage).filter(|pid| !before.contains(pid)));
        for (name, pid) in ["source", "relay", "sink"].into_iter().zip(before) {
            assert!((name == stage) != (running.find_stage(name) == Some(pid)), "{name}: the others continue");
        }
        let barrier = launch.newest_barrier().unwrap_or_default();
        launch.wait_for_barrier_of("sink", barrier + 4);
        assert_eq!(running.find_stage(stage), Some(successor), "{stage}: {}", running.stderr());
        end(&launch, running, 3);
        assert_eq!(launch.summary()["total"]["restarts"], 1, "{stage}");
        assert_eq!(launch.stage_summary(stage)["faults"], 1, "{stage}");
        for topic in ["sweep", "class"] {
            assert!(rises(&seqs(&launch, topic)), "{stage}: no number of {topic} is repeated");
        }
        assert_eq!(leftovers(&replica_tests::domain_of(&launch.output())), Vec::<String>::new());
    }
}

#[test]
fn restarts_of_a_stage_are_limited() {
    let launch = live("restarts = 2");
    let running = launch.start();
    let mut killed: Vec<Pid> = Vec::new();
    while killed.len() < 3 {
        let relay = wait_for("a new relay", || running.find_stage("relay").filter(|pid| !killed.contains(pid)));
        kill_process(relay, Signal::KILL).expect("the stage lives");
        killed.push(relay);
    }
    assert_eq!(running.wait(), Some(1));
    assert_eq!(launch.summary()["outcome"], "failed");
    assert_eq!(launch.stage_summary("relay")["faults"], 3, "{}", launch.stderr());
}

#[test]
fn live_run_cannot_be_resumed() {
    let launch = live("").with("--resume");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        replica_tests::output_text(&output).contains("a live run cannot be resumed"),
        "{}",
        replica_tests::output_text(&output)
    );
}

#[test]
fn stage_killed_before_its_first_tick_repeats_no_message_number() {
    let launch = live("restarts = 9");
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 2);
    let mut killed: Vec<Pid> = Vec::new();
    for _ in 0..4 {
        // Immediately: the next process has hardly started.
        let source = wait_for("a source", || running.find_stage("source").filter(|pid| !killed.contains(pid)));
        kill_process(source, Signal::KILL).expect("the stage lives");
        killed.push(source);
    }
    wait_for("the last successor", || running.find_stage("source").filter(|pid| !killed.contains(pid)));
    let barrier = launch.newest_barrier().unwrap_or_default();
    launch.wait_for_barrier_of("sink", barrier + 4);
    end(&launch, running, 3);
    assert!(rises(&seqs(&launch, "sweep")) && rises(&seqs(&launch, "class")));
}

#[test]
fn recording_is_refused_in_live_mode() {
    let arguments = ["--record", "r.mcap", "--topics", "class"];
    let output = arguments.iter().fold(live(""), |launch, argument| launch.with(argument)).run();
    let text = replica_tests::output_text(&output);
    assert_eq!(output.status.code(), Some(78), "{text}");
    assert!(text.contains("a live run drops messages"), "{text}");
}
