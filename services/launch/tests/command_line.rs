//! What replica-launch says to a wrong command line. Its work is tested in the workspace's tests/.

use std::process::{Command, Output};

fn launch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_replica-launch")).args(arguments).output().expect("starts")
}

#[test]
fn an_absent_launch_file_is_named() {
    let output = launch(&["/nowhere/launch.toml", "--check"]);
    assert_eq!(output.status.code(), Some(78));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("/nowhere/launch.toml: cannot be read: No such file or directory"), "{said}");
}

#[test]
fn an_unknown_option_is_a_usage_error() {
    assert_eq!(launch(&["--chek"]).status.code(), Some(2));
    let help = launch(&["--help"]);
    assert_eq!(help.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&help.stdout).contains("--set <TABLE.KEY=VALUE>"));
}

#[test]
fn a_launch_file_without_stages_has_nothing_to_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("launch.toml");
    std::fs::write(&path, "[run]\ndrive = '.'\noutput = 'out'\n").expect("written");
    let output = launch(&[path.to_str().expect("UTF-8"), "--check"]);
    assert_eq!(output.status.code(), Some(78));
    assert!(String::from_utf8_lossy(&output.stderr).contains("names no stage"));
}
