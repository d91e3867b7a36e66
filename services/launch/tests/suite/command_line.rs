//! Invalid command lines.

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
        assert_eq!(output.status.code(), Some(78), "the file names no stage");
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

#[test]
fn version_has_version_and_commit() {
    let output = launch(&["--version"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let rest = text.strip_prefix(concat!("replica-launch ", env!("CARGO_PKG_VERSION"))).expect(&text).trim_end();
    // ` (ab12cd34ef 2026-11-25)`; without git, nothing.
    let is_commit = rest.starts_with(" (") && rest.ends_with(')') && rest.len() >= " (ab12cd3 2026-11-25)".len();
    assert!(rest.is_empty() || is_commit, "{text}");
}

#[test]
fn completions_and_man_page_describe_every_option() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish"] {
        let output = launch(&["--completions", shell]);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.contains("replica-launch") && text.contains("overwrite"), "{shell}: {text}");
    }
    assert_eq!(launch(&["--completions", "cmd"]).status.code(), Some(2));
    assert!(launch(&["--man", folder.path().to_str().expect("UTF-8")]).status.success());
    let page = std::fs::read_to_string(folder.path().join("replica-launch.1")).expect("written");
    assert!(page.contains("overwrite") && page.contains("Exit codes"), "{page}");
}

#[test]
fn unset_key_has_its_default_and_must_be_set() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("launch.toml");
    std::fs::write(&path, "[run]\ndrive = '.'\noutput = 'out'\nbarrier_s = 7200.0\n").expect("written");
    let check = |arguments: &[&str]| {
        let output = launch(&[&[path.to_str().expect("UTF-8"), "--check"], arguments].concat());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let faulty = check(&[]);
    assert!(faulty.contains("run.barrier_s"), "{faulty}");
    let unset = check(&["--unset", "run.barrier_s"]);
    assert!(!unset.contains("barrier_s") && unset.contains("1 problem"), "only the missing stage: {unset}");
    let set_again = check(&["--unset", "run.barrier_s", "--set", "run.barrier_s=9000"]);
    assert!(set_again.contains("barrier_s") && set_again.contains("9000"), "{set_again}");
    let absent = check(&["--unset", "run.barier_s"]);
    assert!(
        absent
            .contains("--unset run.barier_s: the launch file does not set run.barier_s; did you mean `run.barrier_s`?"),
        "{absent}"
    );
    let stage = check(&["--without", "rum"]);
    assert!(stage.contains("stage rum: no such table in the file; did you mean `run`?"), "{stage}");
}
