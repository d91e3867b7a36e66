//! The screens of `replica-launch` and of `replica status --watch`, on a pseudo-terminal of 80 by 24.

use replica_tests::{Launch, Screen, Terminal, binary, gate, wait_for};
use serde_json::Value;
use std::process::{Command, Stdio};

const SOURCE: &str = "ticks = 400\npoints = 5000\npace_ms = 5";

/// The screen of a run from its start to its end.
fn screen_of_run(launch: &Launch, size: [usize; 2], environment: &[(&str, &str)]) -> Screen {
    let terminal = Terminal::new(size[0], size[1]);
    let mut command = Command::new(binary("replica-launch"));
    let stderr = terminal.program.try_clone().expect("opens");
    command.arg(launch.folder().join("launch.toml")).stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
    let mut child = command.env("TERM", "xterm").envs(environment.iter().copied()).spawn().expect("starts");
    drop(command);
    let screen = terminal.read_to_end();
    // On a busy machine a live run drops messages.
    let code = child.wait().expect("ends").code();
    assert!([Some(0), Some(3)].contains(&code), "{code:?}: {}", screen.written);
    screen
}

#[test]
fn table_is_redrawn_in_place_and_stays_at_the_end() {
    let launch = Launch::misbehaving("", SOURCE, "");
    let screen = screen_of_run(&launch, [80, 24], &[]);
    let all = screen.lines.join("\n");
    assert!(screen.written.matches("STAGE").count() > 2, "drawn several times: {all}");
    let headings = screen.find("STAGE");
    assert_eq!(headings.len(), 1, "{all}");
    let end = screen.find("done: ")[0];
    for (k, stage) in ["source", "relay", "sink"].iter().enumerate() {
        let line = &screen.lines[headings[0] + 1 + k];
        assert!(line.starts_with(stage) && line.contains("done") && line.contains(" 400 "), "{all}");
    }
    assert!(screen.lines[headings[0] + 4].starts_with("[####################] 100 %"), "{all}");
    assert_eq!(end, headings[0] + 5, "{all}");
}

#[test]
fn narrow_and_low_terminals_are_redrawn_in_place() {
    for size in [[50, 24], [80, 5]] {
        let launch = Launch::misbehaving("", SOURCE, "");
        let screen = screen_of_run(&launch, size, &[]);
        let n_progress = screen.find("[##").len();
        assert_eq!(n_progress, 1, "{size:?}: {}", screen.lines.join("\n"));
    }
}

#[test]
fn colors_are_for_terminals_that_want_them() {
    let source = "ticks = 100\npoints = 50\npace_ms = 10";
    let is_colored = |environment| {
        let launch = Launch::misbehaving("", source, "");
        screen_of_run(&launch, [80, 24], environment).written.contains("\x1b[1mSTAGE")
    };
    assert!(is_colored(&[]));
    assert!(!is_colored(&[("NO_COLOR", "1")]));
    assert!(!is_colored(&[("TERM", "dumb")]));
    let launch = Launch::misbehaving("", source, "");
    let stderr = launch.run().stderr;
    assert!(!stderr.contains(&0x1b), "a pipe gets no control sequences");
}

#[test]
fn stage_that_holds_the_others_up_is_named_slowest() {
    let launch = Launch::misbehaving("", "ticks = 200\npoints = 5000", &gate(103)).with("--log").with("json");
    let running = launch.start();
    let slowest = || {
        let text = launch.stderr();
        let event = text.lines().rev().find(|line| line.contains("\"progress\""))?;
        let event: Value = serde_json::from_str(event).ok()?;
        // The source has continued until its queue was full.
        let waits =
            event["stages"][0]["activity"]["kind"] == "blocked" && event["stages"][2]["activity"]["kind"] == "waiting";
        waits.then(|| event["slowest"].as_str().map(str::to_owned)).flatten()
    };
    assert_eq!(wait_for("a progress event of the waiting pipeline", slowest), "relay");
    launch.open_gate();
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
}

#[test]
fn live_run_shows_rates_instead_of_a_share() {
    let launch = Launch::misbehaving("mode = \"live\"", "ticks = 600\npoints = 500\npace_ms = 5", "");
    let screen = screen_of_run(&launch, [80, 24], &[]);
    let all = screen.lines.join("\n");
    assert!(!screen.written.contains("0 %"), "{all}");
    let lines: Vec<&str> = screen.written.lines().filter_map(|line| Some(line.split_once("live  ")?.1)).collect();
    assert!(lines.len() > 2, "{all}");
    for line in &lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [_, "s", _, "ticks/s", _, "M", "points/s", "lag", _, "s", "dropped", _, ..] = words[..] else {
            panic!("{line}")
        };
        assert!([0, 2, 4, 8, 11].iter().all(|number| words[*number].parse::<f64>().is_ok_and(|n| n >= 0.0)), "{line}");
    }
    let seconds = |line: &&str| line.split(' ').next().expect("a word").parse().expect("seconds");
    let elapsed_s: Vec<u32> = lines.iter().map(seconds).collect();
    assert!(elapsed_s.is_sorted(), "{elapsed_s:?}");
}

/// The rates of a live run match the ticks in its events, whatever the speed of the machine.
#[test]
fn live_rates_are_ticks_and_points_by_time() {
    let launch = Launch::misbehaving("mode = \"live\"", "ticks = 600\npoints = 5000\npace_ms = 5", "");
    let launch = launch.with("--log").with("json");
    let code = launch.start().wait();
    assert!([Some(0), Some(3)].contains(&code), "{code:?}: {}", launch.stderr());
    let events: Vec<Value> = launch.stderr().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let events: Vec<&Value> = events.iter().filter(|event| event["kind"] == "progress").collect();
    assert!(events.len() > 2, "{events:?}");
    let number = |event: &Value, before: &str| -> f64 {
        let words: Vec<&str> = event["message"].as_str().expect("a text").split_whitespace().collect();
        words[words.iter().position(|word| *word == before).expect(before) - 1].parse().expect("a number")
    };
    // Rates multiplied by their intervals sum up to the counts.
    let mut n_ticks = 0.0;
    let mut n_points = 0.0;
    for pair in events.windows(2) {
        let seconds = (second_of_day(pair[1]) - second_of_day(pair[0])).rem_euclid(86_400.0);
        n_ticks += number(pair[1], "ticks/s") * seconds;
        n_points += number(pair[1], "M") * 1e6 * seconds;
    }
    let [first, last] = [events[0], events[events.len() - 1]];
    let grown = |stage: usize, key: &str| {
        let [first, last] = [first, last].map(|event| event["stages"][stage][key].as_f64().expect("a number"));
        last - first
    };
    let true_ticks = grown(0, "ticks");
    let true_points = grown(2, "points");
    assert!(true_ticks > 100.0, "{true_ticks} ticks: the events are from the run");
    assert!((n_ticks / true_ticks - 1.0).abs() < 0.1, "{n_ticks} ticks by rates, {true_ticks} by counts");
    assert!((n_points / true_points - 1.0).abs() < 0.1, "{n_points} points by rates, {true_points} by counts");
}

/// Seconds since midnight (UTC) of an event.
fn second_of_day(event: &Value) -> f64 {
    let stamp = event["timestamp"].as_str().expect("a time");
    let (_, time) = stamp.trim_end_matches('Z').split_once('T').expect("RFC 3339");
    time.split(':').fold(0.0, |seconds, part| 60.0 * seconds + part.parse::<f64>().expect("a number"))
}

#[test]
fn status_is_redrawn_in_place_on_80_by_24() {
    let launch = Launch::misbehaving("", "ticks = 200\npoints = 5000", &gate(103));
    let running = launch.start();
    launch.wait_for_barrier(10);
    let mut terminal = Terminal::new(80, 24);
    let mut command = Command::new(binary("replica"));
    command.args(["status", "--watch", "--interval", "0.2", "--run"]).arg(launch.output()).env("TERM", "xterm");
    command.stdin(Stdio::null()).stdout(terminal.program.try_clone().expect("opens"));
    let mut status = command.spawn().expect("starts");
    drop(command);
    // The table is redrawn while the run waits at the gate.
    terminal.read_until("STAGE", 4);
    launch.open_gate();
    let screen = terminal.read_to_end();
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    assert!(status.wait().expect("ends").success());
    let all = screen.lines.join("\n");
    assert_eq!((screen.find("STAGE").len(), screen.find("TOPIC").len()), (1, 1), "{all}");
    assert!(screen.written.contains("waiting for output sweep"), "{}", screen.written);
}
