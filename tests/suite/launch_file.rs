//! `--check` reports all problems of a launch file at once, with their lines, and starts nothing.

use replica_tests::{Launch, binary, gate, output_text};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

#[test]
fn faulty_file_is_reported_completely_with_lines() {
    let source = binary("misbehaving-source").display().to_string();
    let relay = binary("misbehaving-relay").display().to_string();
    let text = format!(
        "[run]\ndrive = \"nowhere\"\noutput = \"out\"\nrestart = 3\nhang_s = \"long\"\n\n\
         [source]\nprogram = '{source}'\ntick = 4\npoints = -1\n\n\
         [relay]\nprogram = '{relay}'\nfault = \"flood\"\n\n\
         [slam_agregate]\n"
    );
    let launch = Launch::new(&text).with("--check").with("--set").with("source.ticks=0");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(78), "{}", output_text(&output));
    let output_text = output_text(&output);
    for (place, words) in [
        ("launch.toml:2:9:", "run.drive: "),
        ("launch.toml:4:1:", "run.restart: unknown key; did you mean `restarts`?"),
        ("launch.toml:5:10:", "run.hang_s: invalid type: string \"long\", expected f64"),
        ("launch.toml:9:1:", "source.tick: unknown key; did you mean `ticks`?"),
        ("launch.toml:10:10:", "source.points: "),
        ("launch.toml:14:9:", "relay.fault: value \"flood\" must be one of none, error, exit, panic, hang, stall"),
        ("launch.toml:16:2:", "slam_agregate: no such stage; did you mean `slam_aggregate`?"),
        ("launch.toml:", "source.ticks: value 0 must be between 1 and 1000000 (from --set)"),
    ] {
        assert!(
            output_text.lines().any(|line| line.contains(place) && line.contains(words)),
            "no line with {place} and {words:?} in:\n{output_text}"
        );
    }
    assert!(output_text.contains("8 problems"), "{output_text}");
    assert!(!launch.output().exists(), "--check starts nothing and writes nothing");
}

#[test]
fn mismatched_stages_are_reported() {
    let relay = binary("misbehaving-relay").display().to_string();
    let text =
        format!("[run]\ndrive = \".\"\noutput = \"out\"\n[relay]\nprogram = '{relay}'\n[other]\nprogram = '{relay}'\n");
    let output = Launch::new(&text).with("--check").run();
    assert_eq!(output.status.code(), Some(78));
    let output_text = output_text(&output);
    assert!(output_text.contains("[relay]"), "{output_text}");
    for words in [
        "launch.toml:4:2: relay: needs topic sweep, which no stage of this file produces",
        "launch.toml:6:2: other: topic class is already produced by [relay]",
    ] {
        assert!(output_text.contains(words), "{words:?} is not in:\n{output_text}");
    }
}

#[test]
fn program_killed_during_the_check_is_a_failure_and_not_a_problem_of_the_file() {
    let launch = Launch::misbehaving("", "", "");
    let killed = launch.folder().join("killed.sh");
    std::fs::write(&killed, "#!/bin/sh\nkill -9 $$\n").expect("written");
    std::fs::set_permissions(&killed, Permissions::from_mode(0o755)).expect("executable");
    let launch = launch.with("--check").with("--set").with("source.program=killed.sh");
    let output = launch.run();
    let text = output_text(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("killed.sh --describe: signal: 9 (SIGKILL)"), "{text}");
    assert!(text.contains("1 problem; a program failed during the check, so try again"), "{text}");
    assert!(!text.contains("which no stage of this file produces"), "{text}");
}

#[test]
fn run_with_a_small_stack_succeeds() {
    let launch = Launch::misbehaving("report = true", "ticks = 20\npoints = 500", "");
    let mut command = Command::new("sh");
    let command = command.args(["-c", "ulimit -s 128; exec \"$0\" \"$1\""]);
    let output = command.arg(binary("replica-launch")).arg(launch.folder().join("launch.toml")).output();
    let output = output.expect("sh starts");
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert!(launch.output().join("report.html").exists(), "{}", output_text(&output));
}

#[test]
fn number_of_threads_of_the_environment_has_a_bound() {
    let launch = Launch::misbehaving("", "ticks = 20\npoints = 500", &gate(19));
    let mut running = launch.start_with_env("RAYON_NUM_THREADS", "100000");
    launch.wait_for_barrier(1);
    for stage in ["source", "relay", "sink"] {
        let environment = std::fs::read(format!("/proc/{}/environ", running.stage(stage).as_raw_nonzero()));
        let environment = String::from_utf8(environment.expect("a process")).expect("text");
        let number = environment.split('\0').find_map(|line| line.strip_prefix("RAYON_NUM_THREADS="));
        let number: usize = number.expect("set").parse().expect("a number");
        assert!((16..1000).contains(&number), "{stage}: {number}");
    }
    assert_eq!(running.ended(), None);
    launch.open_gate();
    assert_eq!(running.wait(), Some(0));
}

#[test]
fn invalid_stage_names_are_refused() {
    let relay = binary("misbehaving-relay").display().to_string();
    let text = format!(
        "[run]\ndrive = \".\"\noutput = \"out\"\n['../x']\nprogram = '{relay}'\n[settings]\nprogram = '{relay}'\n"
    );
    let output = Launch::new(&text).with("--check").with("--set").with("infr.model=3").run();
    assert_eq!(output.status.code(), Some(78));
    let output_text = output_text(&output);
    for words in [
        "launch.toml:4:2: ../x: a stage's name",
        "launch.toml:6:2: settings: a stage's name",
        "launch.toml: infr: no such stage",
    ] {
        assert!(output_text.contains(words), "{words:?} is not in:\n{output_text}");
    }
}

#[test]
fn invalid_toml_is_reported_with_its_line() {
    let output = Launch::new("[run]\ndrive = \n").with("--check").run();
    assert_eq!(output.status.code(), Some(78));
    assert!(output_text(&output).contains("launch.toml:2:"), "{}", output_text(&output));
}

#[test]
fn graph_shows_the_dataflow_of_the_file() {
    let launch = Launch::misbehaving("", "", "").with("--graph");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let graph = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in ["flowchart LR", "source -- sweep --> relay", "source -- sweep --> sink", "relay -- class --> sink"] {
        assert!(graph.contains(line), "{line:?} is not in:\n{graph}");
    }
}

/// The small pipeline, whose source needs no drive, with `drive = "<drive>"` and the further text in the file.
fn with_drive(drive: &str, rest: &str) -> Launch {
    let launch = Launch::misbehaving("", "ticks = 3", "");
    let path = launch.folder().join("launch.toml");
    let text = std::fs::read_to_string(&path).expect("written").replace("drive = \".\"", &format!("drive = '{drive}'"));
    std::fs::write(path, format!("{text}{rest}")).expect("written");
    launch
}

const SIMULATE: &str = "[simulate]\nseconds = 1.0\nrig = 'survey'\n";

#[test]
fn drive_of_the_launch_file_is_simulated_and_check_says_so() {
    let launch = with_drive("drives/town", SIMULATE).with("--check");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(stdout.contains("drives/town does not exist: a start simulates it"), "{stdout}");
    assert!(!launch.folder().join("drives").exists(), "--check simulates nothing");
}

#[test]
fn faulty_simulate_table_is_refused_with_file_line_key_and_rule() {
    let table = "[simulate]\nseconds = 9000.0\ntown = 'citty'\nsecond = 1.0\n";
    let output = with_drive("drives/town", table).with("--check").run();
    let output_text = output_text(&output);
    assert_eq!(output.status.code(), Some(78), "{output_text}");
    let path = "launch.toml";
    let text = |key: &str| output_text.lines().find(|line| line.contains(&format!("simulate.{key}: "))).expect(key);
    for (key, rule) in [
        ("seconds", "value 9000.0 must be between 0.2 and 2400"),
        ("town", "value \"citty\" must be one of urban, suburban, rural, field, tunnel, motorway"),
        ("second", "unknown key; did you mean `seconds`?"),
    ] {
        let line = text(key);
        let place = line.split_once(path).expect(line).1;
        let [number, column] =
            [1, 2].map(|field| place.split(':').nth(field).expect(line).parse::<usize>().expect(line));
        assert!(number > 1 && column >= 1 && line.ends_with(rule), "{line}");
    }
}

/// Regression: a mistyped drive was simulated and processed as if it were the recording.
#[test]
fn mistyped_drive_is_not_simulated() {
    for (launch, words) in [
        (with_drive("drives/town", SIMULATE).with("--set").with("run.drive=drives/twon"), "replica simulate --out "),
        (with_drive(".", SIMULATE).with("--set").with("run.drive=drives/twon"), "replica simulate --out "),
        (with_drive("drives/twon", ""), "has no [simulate] to simulate it"),
        (with_drive("drives/twon", "").with("--set").with("simulate.seed=3"), "has no [simulate] to simulate it"),
    ] {
        let output = launch.run();
        let output_text = output_text(&output);
        assert_eq!(output.status.code(), Some(78), "{output_text}");
        assert!(output_text.contains("drives/twon does not exist") && output_text.contains(words), "{output_text}");
        assert!(!launch.folder().join("drives").exists() && !launch.output().exists(), "{output_text}");
    }
}

/// Regression: another seed in [simulate] was ignored, and the drive of the old seed was processed.
#[test]
fn simulated_drive_that_differs_from_the_table_is_refused() {
    let launch = with_drive("drives/town", SIMULATE);
    let folder = launch.folder().join("drives/town");
    std::fs::create_dir_all(&folder).expect("made");
    std::fs::write(folder.join("simulated.toml"), "town = 'urban'\nseed = 1\nseconds = 1.0\n").expect("written");
    let launch = launch.with("--check");
    assert_eq!(launch.run().status.code(), Some(0), "as the table says");
    let output = launch.with("--set").with("simulate.seed=2").run();
    let output_text = output_text(&output);
    assert_eq!(output.status.code(), Some(78), "{output_text}");
    assert!(output_text.contains("drives/town was simulated with seed = 1, not 2; remove it"), "{output_text}");
}
