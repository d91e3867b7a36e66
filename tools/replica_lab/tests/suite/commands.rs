//! The command line itself: completions and manual pages.

use crate::support::{replica_lab, succeeded, text};

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
fn manual_pages_are_those_of_all_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    succeeded(&replica_lab(&["man", "--out", text(folder.path())]));
    let page = std::fs::read_to_string(folder.path().join("replica-lab-evaluate-map.1")).expect("a page");
    assert!(page.contains("radius\\-m"), "{page}");
    assert!(std::fs::read_dir(folder.path()).expect("a folder").count() > 10);
}
