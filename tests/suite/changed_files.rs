//! Programs, models and other files that change during a run: it does not continue with changed content.

use replica_tests::{Launch, Running, binary, gate, undisturbed, wait_for};
use rustix::process::{Signal, kill_process};
use std::path::{Path, PathBuf};

const SOURCE: &str = "ticks = 400\npoints = 5000";
const STAGES: [&str; 3] = ["source", "relay", "sink"];

/// The small pipeline with its own relay program, and a manifest of its drive.
fn launch(relay: &str) -> Launch {
    let launch = Launch::misbehaving("", SOURCE, relay);
    let path = launch.folder().join("launch.toml");
    let program = binary("misbehaving-relay");
    let text = std::fs::read_to_string(&path).expect("written").replace(&program.display().to_string(), "relay");
    std::fs::write(path, text).expect("written");
    std::fs::copy(program, relay_of(&launch)).expect("copied");
    std::fs::write(launch.folder().join("drive.toml"), "# of the drive\n").expect("written");
    launch
}

fn relay_of(launch: &Launch) -> PathBuf {
    launch.folder().join("relay")
}

/// Replaces a file as a build does: another file gets its name. Returns the previous bytes.
fn change(path: &Path) -> Vec<u8> {
    let before = std::fs::read(path).expect("there");
    put(path, &[&before[..], b"\n"].concat());
    before
}

fn put(path: &Path, bytes: &[u8]) {
    let next = path.with_extension("next");
    std::fs::copy(path, &next).expect("with its rights");
    std::fs::write(&next, bytes).expect("written");
    std::fs::rename(next, path).expect("renamed");
}

fn end(mut running: Running) -> (Option<i32>, String) {
    let code = wait_for("the end of the run", || running.ended());
    (code, running.stderr())
}

/// Regression: half of one cloud came from one network, half from another.
#[test]
fn resume_with_another_program_or_manifest_is_refused_and_names_the_file() {
    let launch = launch(&gate(203));
    launch.kill_at_barrier(20, &STAGES);
    for file in [relay_of(&launch), launch.folder().join("drive.toml")] {
        let before = change(&file);
        let (code, text) = end(launch.start_again(&["--resume"]));
        assert_eq!(code, Some(78), "{text}");
        let name = file.file_name().expect("a name").to_string_lossy().into_owned();
        assert!(text.contains(&format!("/{name}: its content has changed since the run into ")), "{text}");
        put(&file, &before);
    }
    let (code, text) = end(launch.start_again(&["--resume"]));
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("resuming from barrier "), "{text}");
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "{text}");
}

#[test]
fn restart_with_another_program_is_refused() {
    let launch = launch(&gate(203));
    let running = launch.start();
    launch.wait_for_barrier(20);
    change(&relay_of(&launch));
    kill_process(running.stage("sink"), Signal::KILL).expect("the stage lives");
    let (code, text) = end(running);
    assert_eq!(code, Some(78), "{text}");
    assert!(text.contains("/relay: its content has changed since the run into "), "{text}");
}
