//! Wrong command lines.

use std::process::{Command, Output};

fn launch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_replica-launch")).args(arguments).output().expect("starts")
}

#[test]
fn absent_launch_file_is_reported() {
    let output = launch(&["/nowhere/launch.toml", "--check"]);
    assert_eq!(output.status.code(), Some(78));
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(stderr.contains("/nowhere/launch.toml: cannot be read: No such file or directory"), "{stderr}");
}

#[test]
fn unknown_option_is_a_usage_error() {
    assert_eq!(launch(&["--chek"]).status.code(), Some(2));
    let help = launch(&["--help"]);
    assert_eq!(help.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&help.stdout).contains("--set <TABLE.KEY=VALUE>"));
}

#[test]
fn launch_file_without_stages_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("launch.toml");
    std::fs::write(&path, "[run]\ndrive = '.'\noutput = 'out'\n").expect("written");
    let output = launch(&[path.to_str().expect("UTF-8"), "--check"]);
    assert_eq!(output.status.code(), Some(78));
    assert!(String::from_utf8_lossy(&output.stderr).contains("names no stage"));
}

#[test]
fn rig_of_a_live_run_must_exist_and_replaces_the_drive() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("launch.toml");
    let check = |run: &str| {
        std::fs::write(&path, format!("[run]\ndrive = 'nowhere'\noutput = 'out'\n{run}\n")).expect("written");
        let output = launch(&[path.to_str().expect("UTF-8"), "--check"]);
        assert_eq!(output.status.code(), Some(78), "it names no stage");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let without = check("mode = 'live'");
    assert!(without.contains("nowhere does not exist"), "{without}");
    let absent = check("mode = 'live'\nrig = 'vehicle.toml'");
    assert!(absent.contains("vehicle.toml is not a file") && absent.contains("launch.toml:5"), "{absent}");
    std::fs::write(folder.path().join("vehicle.toml"), "version = 1\n").expect("written");
    let found = check("mode = 'live'\nrig = 'vehicle.toml'");
    assert!(!found.contains("vehicle.toml") && !found.contains("nowhere"), "{found}");
    let offline = check("rig = 'vehicle.toml'");
    assert!(offline.contains("is for live runs"), "{offline}");
}
