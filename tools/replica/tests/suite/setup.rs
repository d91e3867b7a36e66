//! Completions and manual pages.

use crate::support::{printed, replica, succeeded, text};

#[test]
fn completions_of_each_shell_name_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let script = succeeded(&replica(&["completions", shell]));
        for command in ["inspect", "evaluate", "completions"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
    let output = replica(&["completions", "cmd"]);
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
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
    assert!(names(&first).len() > 30, "{:?}", names(&first));
    for name in names(&first) {
        let read = |pages: &std::path::Path| std::fs::read(pages.join(&name)).expect("a page");
        assert!(read(&first) == read(&second), "{name:?}");
    }
    let page = std::fs::read_to_string(first.join("replica-evaluate-map.1")).expect("a page");
    assert!(page.contains("radius\\-m"), "{page}");
}
