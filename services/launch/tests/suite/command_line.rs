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
