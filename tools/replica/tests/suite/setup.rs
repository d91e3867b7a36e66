//! Completions, manual pages, and the check of the machine.

use crate::support::{printed, replica, succeeded, text};
use serde_json::Value;
use std::process::Command;

#[test]
fn completions_of_each_shell_name_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let script = succeeded(&replica(&["completions", shell]));
        for command in ["inspect", "deliver", "completions"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
    let output = replica(&["completions", "cmd"]);
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
}

#[test]
fn command_of_the_laboratory_is_refused_with_the_name_of_its_program() {
    for command in ["train", "fuse", "evaluate", "bench", "spectrum", "cube"] {
        let output = replica(&[command, "a", "--out", "b"]);
        assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
        let said = printed(&output);
        assert!(
            said.contains(&format!("error: the command `{command}` is in replica-lab\nhint: replica-lab {command}")),
            "{said}"
        );
    }
    let output = replica(&["trian"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!printed(&output).contains("replica-lab"), "{}", printed(&output));
}

#[test]
fn manual_pages_are_those_of_all_commands_and_reproducible() {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    for pages in [&first, &second] {
        succeeded(&replica(&["man", "--out", text(pages)]));
    }
    let names = |pages: &std::path::Path| {
        let mut names: Vec<_> = std::fs::read_dir(pages).expect("a folder").flatten().map(|e| e.file_name()).collect();
        names.sort();
        names
    };
    assert!(names(&first).len() > 25, "{:?}", names(&first));
    for name in names(&first) {
        let read = |pages: &std::path::Path| std::fs::read(pages.join(&name)).expect("a page");
        assert!(read(&first) == read(&second), "{name:?}");
    }
    let page = std::fs::read_to_string(first.join("replica-rig-check.1")).expect("a page");
    assert!(page.contains("json"), "{page}");
}

#[test]
fn new_stage_has_the_files_of_its_language_and_bad_names_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = |name: &str, lang: &str| replica(&["new-stage", name, "--lang", lang, "--out", text(folder.path())]);
    for (lang, name, files) in [
        ("rust", "heights", &["Cargo.toml", "Cargo.lock", "src/main.rs", "launch.toml"][..]),
        ("python", "levels", &["levels.py", "launch.toml"]),
    ] {
        let next = succeeded(&made(name, lang));
        assert!(next.contains("replica-launch launch.toml --check"), "{next}");
        for file in files {
            let written = std::fs::read_to_string(folder.path().join(name).join(file)).expect("a file");
            let is_filled_in = ["{name}", "{library}", "{keys}"].iter().all(|place| !written.contains(place));
            assert!(is_filled_in && (file == &"Cargo.lock" || written.contains(name)), "{file}: {written}");
        }
        let output = made(name, lang);
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains("exists already"), "{}", printed(&output));
    }
    for name in ["Heights", "7th", "run", "my-stage"] {
        assert_eq!(made(name, "rust").status.code(), Some(2), "{name}");
    }
}

/// The checks of `replica doctor --json` under these limits, by subject; the exit code.
fn examined(limits: &str) -> (Vec<Value>, Option<i32>) {
    let script = format!("{limits}; exec \"$0\" doctor --json");
    let output = Command::new("bash").args(["-c", &script, env!("CARGO_BIN_EXE_replica")]).output().expect("starts");
    let facts: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    (facts["checks"].as_array().expect("a list").clone(), output.status.code())
}

fn check<'a>(checks: &'a [Value], subject: &str) -> &'a Value {
    checks.iter().find(|check| check["subject"] == subject).expect("is examined")
}

#[test]
fn doctor_states_value_rule_and_advice_of_each_finding() {
    let (checks, code) = examined("true");
    for check in &checks {
        assert!(check["found"].as_str().is_some_and(|text| !text.is_empty()), "{check}");
        assert!(check["rule"].as_str().is_some_and(|text| !text.is_empty()), "{check}");
        assert_eq!(check["advice"].is_null(), check["state"] == "ok", "{check}");
    }
    let has = |state: &str| checks.iter().any(|check| check["state"] == state);
    let expected = if has("problem") {
        1
    } else if has("warning") {
        3
    } else {
        0
    };
    assert_eq!(code, Some(expected), "{checks:?}");
    assert_eq!(check(&checks, "open files")["state"], "ok", "limits of the tests");
}

#[test]
fn doctor_finds_low_limits() {
    let (checks, code) = examined("ulimit -n 200; ulimit -f 1000");
    let files = check(&checks, "open files");
    assert_eq!((&files["state"], &files["found"]), (&"problem".into(), &"200".into()));
    assert_eq!(check(&checks, "file size")["state"], "warning");
    assert_eq!(code, Some(1));
}

#[test]
fn doctor_finds_memory_of_a_killed_run_and_names_its_output() {
    let name = format!("doctor{}", std::process::id());
    let folder = std::path::PathBuf::from(format!("/dev/shm/replica_{name}"));
    std::fs::create_dir(&folder).expect("made");
    std::fs::write(folder.join("output"), "/nowhere/out").expect("written");
    let (checks, _) = examined("true");
    std::fs::remove_dir_all(&folder).expect("removed");
    let leftovers = check(&checks, "leftovers");
    assert_eq!(leftovers["state"], "warning");
    let advice = leftovers["advice"].as_str().expect("text");
    assert!(advice.contains(&format!("rm -r /dev/shm/replica_{name}*   # of /nowhere/out")), "{advice}");
}

#[test]
fn doctor_reports_a_launch_file_that_does_not_exist() {
    let output = replica(&["doctor", "/nowhere/launch.toml"]);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    let said = printed(&output);
    assert!(said.lines().any(|line| line.starts_with("problem  launch file")), "{said}");
}
