//! The command line itself: completions and manual pages.

use crate::support::{printed, replica_lab, succeeded, text};
use std::process::Command;

#[test]
fn completions_of_each_shell_name_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let script = succeeded(&replica_lab(&["completions", shell]));
        for command in ["train", "evaluate", "spectrum", "completions"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
}

#[test]
fn recipe_may_have_any_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut train = Command::new(env!("CARGO_BIN_EXE_replica-lab"));
    let output =
        train.args(["train", "materials", "--out", "out"]).current_dir(folder.path()).output().expect("starts");
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(printed(&output).contains("error: materials:"), "{}", printed(&output));
}

#[test]
fn manual_pages_are_those_of_all_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    succeeded(&replica_lab(&["man", "--out", text(folder.path())]));
    let page = std::fs::read_to_string(folder.path().join("replica-lab-evaluate-map.1")).expect("a page");
    assert!(page.contains("radius\\-m"), "{page}");
    assert!(std::fs::read_dir(folder.path()).expect("a folder").count() > 10);
}
