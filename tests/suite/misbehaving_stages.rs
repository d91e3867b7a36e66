//! Stages that break their contract, one test each: the fault is reported, and the run ends or recovers.

use replica_tests::{Launch, Running, binary, is_alive, output_text, reported_seconds, undisturbed, wait_for};
use rustix::process::Signal;

const SOURCE: &str = "ticks = 60\npoints = 500";
const ENDLESS: &str = "ticks = 1000000\npoints = 500";

fn end(mut running: Running) -> (Option<i32>, String) {
    let code = wait_for("the end of the run", || running.ended());
    (code, running.stderr())
}

/// Checks a fault that recurs after every restart: the run is given up and reports the reason.
fn is_given_up(fault: &str, words: &str) {
    let launch = Launch::misbehaving("restarts = 1", SOURCE, &format!("fault = \"{fault}\"\nat_tick = 23"));
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    assert_eq!(output_text(&output).matches(words).count(), 2, "{words:?} twice in:\n{}", output_text(&output));
    assert!(
        output_text(&output)
            .contains("giving up: no progress after 1 restarts; --resume would continue from barrier 4"),
        "{}",
        output_text(&output)
    );
    assert_eq!(launch.summary()["outcome"], "failed");
}

/// Checks a fault that occurs once, before the stage is ready, and is reported with at least this many seconds after
/// `words`.
fn recovers_at_start(run: &str, relay: &str, fault: &str, words: &str, seconds: f64) {
    let relay = format!("fault = \"{fault}\"\nonce = \"struck\"\n{relay}");
    let launch = Launch::misbehaving(run, SOURCE, &relay);
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(reported_seconds(&output_text(&output), words) >= seconds, "{}", output_text(&output));
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "{fault} changed the result");
}

/// The other stages wait equally long for it to open its topics, and are not to blame.
#[test]
fn stage_stalled_in_its_start_is_restarted() {
    recovers_at_start("stall_s = 8.0", "stall_s = 10.0", "stalls_at_start", "[relay] stall: ", 10.0);
}

#[test]
fn stage_hung_in_its_start_is_restarted() {
    recovers_at_start("hang_s = 10.0", "", "hangs_at_start", "[relay] hang: no heartbeat for ", 10.0);
}

#[test]
fn stage_that_keeps_its_loans_is_given_up_with_the_limit() {
    is_given_up("leaks_loans", "a stage may hold 2 loans of a topic at a time");
}

#[test]
fn unsaved_state_completes_no_barrier_and_is_reported() {
    // The source ends just after the first barrier: no tick follows while the state fails.
    let launch = Launch::misbehaving("restarts = 1", "ticks = 8\npoints = 500", "fault = \"relies_on_nothing\"");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    let words = "not_there.ply: No such file or directory";
    assert_eq!(output_text(&output).matches(words).count(), 2, "{words:?} twice in:\n{}", output_text(&output));
    assert!(!launch.states().join("1/relay.state").exists());
    assert_eq!(launch.summary()["outcome"], "failed");
}

#[test]
fn stage_that_floods_its_topic_is_given_up() {
    is_given_up("floods_topic", "class: more than 3 messages in one tick");
}

#[test]
fn program_with_another_version_than_described_is_refused() {
    let launch = Launch::misbehaving("restarts = 1", SOURCE, "");
    let text = std::fs::read_to_string(launch.folder().join("launch.toml")).expect("written");
    let relay = binary("misbehaving-relay").display().to_string();
    let text = text.replace(&relay, &binary("misbehaving-liar").display().to_string());
    let launch = Launch::new(&text);
    let output = launch.run();
    assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
    for words in ["opening topic class: this program has version 2, layout ", "; the run has version 1, layout "] {
        assert!(output_text(&output).contains(words), "{words:?} is not in:\n{}", output_text(&output));
    }
    assert!(!launch.output().join("sink.txt").exists(), "no stage has connected to it");
}

/// The transport does not interpret coordinates; stages define the meaning of NaN.
#[test]
fn nan_coordinates_pass_unchanged() {
    let with_nan = format!("{SOURCE}\nnan_from = 30");
    let first = Launch::misbehaving("", &with_nan, "");
    let killed = Launch::misbehaving("", &with_nan, "fault = \"error\"\nat_tick = 43\nonce = \"struck\"");
    for launch in [&first, &killed] {
        let output = launch.run();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    }
    assert!(first.read("sink.txt") == killed.read("sink.txt"), "NaN keeps its bits through a restart");
    assert!(first.read("sink.txt") != undisturbed(SOURCE, ""));
}

#[test]
fn slow_consumer_applies_back_pressure_and_loses_nothing() {
    let source = "ticks = 150\npoints = 20000";
    let fast = Launch::misbehaving("", source, "");
    let slow = Launch::misbehaving("", source, "").with("--set").with("sink.slow_ms=10");
    for launch in [&fast, &slow] {
        let output = launch.run();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    }
    assert!(slow.read("sink.txt") == fast.read("sink.txt"));
    // Sweeps of 20 000 points of 24 bytes: queue 4, borrowed 4 and again a queue for each of two consumers, two loans;
    // columns are a tenth of that. A run with unbounded queues would need 150 of them.
    let peak = slow.summary()["total"]["peak_shared_memory_bytes"].as_u64().expect("a number");
    let sweep = slow.stage_summary("source")["outputs"]["sweep"]["bytes"].as_u64().expect("a number") / 150;
    assert!(peak < 40 * sweep, "{peak} bytes of shared memory, a sweep has {sweep}");
}

/// Two Ctrl-C stop even a stage that does not handle SIGTERM.
#[test]
fn stage_that_ignores_sigterm_is_killed() {
    let launch = Launch::misbehaving("", ENDLESS, "fault = \"stall\"\nat_tick = 23\nonce = \"struck\"");
    let running = launch.start();
    wait_for("the stall", || launch.output().join("struck").exists().then_some(()));
    let relay = running.stage("relay");
    running.signal(Signal::INT);
    wait_for("the drain", || running.stderr().contains("draining").then_some(()));
    running.signal(Signal::INT);
    assert_eq!(end(running).0, Some(1));
    assert!(!is_alive(relay));
    assert_eq!(launch.summary()["outcome"], "stopped");
}

#[test]
fn ctrl_c_while_stages_start_drains_the_run_at_once() {
    let launch = Launch::misbehaving("", ENDLESS, "fault = \"waits_at_start\"\nonce = \"../gate\"");
    let running = launch.start();
    running.stage("relay");
    running.signal(Signal::INT);
    wait_for("the drain", || running.stderr().contains("draining").then_some(()));
    launch.open_gate();
    let (code, output_text) = end(running);
    assert_eq!(code, Some(3), "{output_text}");
    assert_eq!(launch.summary()["outcome"], "drained");
    assert_eq!(launch.stage_summary("source")["ticks"], 1, "{output_text}");
    assert_eq!(String::from_utf8(launch.read("sink.txt")).expect("text").lines().count(), 2);
}

#[test]
fn ctrl_c_in_the_pause_before_a_restart_stops_the_run() {
    let launch = Launch::misbehaving("restarts = 9", SOURCE, "fault = \"error\"\nat_tick = 23")
        .with("--set")
        .with("run.restart_delay_s=30.0");
    let running = launch.start();
    wait_for("the pause", || running.stderr().contains("restart 1 of 9 from barrier 4 in 30.0 s").then_some(()));
    running.signal(Signal::INT);
    let (code, output_text) = end(running);
    assert_eq!(code, Some(1), "{output_text}");
    assert_eq!(launch.summary()["outcome"], "stopped");
    assert!(!output_text.contains("restart 2"), "{output_text}");
}
