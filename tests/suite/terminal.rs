//! The screens of `replica-launch` and of `replica status --watch`, on a pseudo-terminal of 80 by 24.

use replica_tests::{Launch, Screen, Terminal, binary, gate, wait_for};
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
    let launch = Launch::of_misbehaving("", SOURCE, "");
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
        let launch = Launch::of_misbehaving("", SOURCE, "");
        let screen = screen_of_run(&launch, size, &[]);
        let n_progress = screen.find("[##").len();
        assert_eq!(n_progress, 1, "{size:?}: {}", screen.lines.join("\n"));
    }
}

#[test]
fn colors_are_for_terminals_that_want_them() {
    let source = "ticks = 100\npoints = 50\npace_ms = 10";
    let is_colored = |environment| {
        let launch = Launch::of_misbehaving("", source, "");
        screen_of_run(&launch, [80, 24], environment).written.contains("\x1b[1mSTAGE")
    };
    assert!(is_colored(&[]));
    assert!(!is_colored(&[("NO_COLOR", "1")]));
    assert!(!is_colored(&[("TERM", "dumb")]));
    let launch = Launch::of_misbehaving("", source, "");
    let stderr = launch.run().stderr;
    assert!(!stderr.contains(&0x1b), "a pipe gets no control sequences");
}

#[test]
fn stage_that_holds_the_others_up_is_named_slowest() {
    let launch = Launch::of_misbehaving("", "ticks = 200\npoints = 5000", &gate(103)).with("--log").with("json");
    let running = launch.start();
    let slowest = || {
        let text = launch.stderr();
        let event = text.lines().rev().find(|line| line.contains("\"progress\""))?;
        let event: serde_json::Value = serde_json::from_str(event).ok()?;
        // The source has gone on until its queue was full.
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
    let launch = Launch::of_misbehaving("mode = \"live\"", "ticks = 600\npoints = 500\npace_ms = 5", "");
    let screen = screen_of_run(&launch, [80, 24], &[]);
    let all = screen.lines.join("\n");
    assert!(!screen.written.contains("0 %"), "{all}");
    let line = screen.written.lines().filter(|line| line.contains("live  ")).nth(2).expect(&all);
    let words: Vec<&str> = line.split_whitespace().collect();
    let before =
        |unit: &str| words[words.iter().position(|word| *word == unit).expect(line) - 1].parse::<f64>().expect(line);
    assert!((1.0..400.0).contains(&before("ticks/s")), "{line}");
    assert!(before("s") < 60.0 && words.contains(&"dropped"), "{line}");
}

#[test]
fn status_is_redrawn_in_place_on_80_by_24() {
    let launch = Launch::of_misbehaving("", "ticks = 200\npoints = 5000", &gate(103));
    let running = launch.start();
    launch.wait_for_barrier(10);
    let terminal = Terminal::new(80, 24);
    let mut command = Command::new(binary("replica"));
    command.args(["status", "--watch", "--interval", "0.2", "--run"]).arg(launch.output()).env("TERM", "xterm");
    command.stdin(Stdio::null()).stdout(terminal.program.try_clone().expect("opens"));
    let mut status = command.spawn().expect("starts");
    drop(command);
    let reader =
        std::thread::Builder::new().name("screen".to_owned()).spawn(|| terminal.read_to_end()).expect("starts");
    std::thread::sleep(std::time::Duration::from_secs(2));
    launch.open_gate();
    assert_eq!(running.wait(), Some(0), "{}", launch.stderr());
    assert!(status.wait().expect("ends").success());
    let screen = reader.join().expect("reads");
    let all = screen.lines.join("\n");
    assert!(screen.written.matches("STAGE").count() > 3, "{all}");
    assert_eq!((screen.find("STAGE").len(), screen.find("TOPIC").len()), (1, 1), "{all}");
    assert!(screen.written.contains("waiting for output sweep"), "{}", screen.written);
}
