//! Shared code of the tests of swaps: `replica swap` and `replica stop` against a run.

use crate::{Launch, Running, binary, output_text, wait_for};
use std::process::{Child, Command, Output, Stdio};

/// A command of `replica` about the run.
pub fn replica(launch: &Launch, arguments: &[&str]) -> Command {
    let mut command = Command::new(binary("replica"));
    command.args(arguments).arg("--run").arg(launch.output()).stdin(Stdio::null());
    command
}

/// Runs `replica swap …` to its end.
pub fn swap(launch: &Launch, arguments: &[&str]) -> Output {
    replica(launch, &[&["swap"], arguments].concat()).output().expect("replica starts")
}

/// Runs a swap that must succeed. Returns its output.
pub fn swapped(launch: &Launch, arguments: &[&str]) -> String {
    let output = swap(launch, arguments);
    assert!(output.status.success(), "{}", output_text(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a swap that must be refused with reasons that contain `words`.
pub fn refused(launch: &Launch, arguments: &[&str], words: &[&str]) {
    let output = swap(launch, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", output_text(&output));
    for word in words.iter().chain(&["nothing was changed"]) {
        assert!(output_text(&output).contains(word), "{arguments:?}: {word:?} is not in:\n{}", output_text(&output));
    }
}

/// Drains the run. Returns the output of `replica stop`.
pub fn stop(launch: &Launch) -> String {
    let output = replica(launch, &["stop"]).output().expect("replica starts");
    assert!(output.status.success(), "{}", output_text(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// A run that has reached its first barrier.
pub fn started(launch: &Launch) -> Running {
    let running = launch.start();
    launch.wait_for_barrier(1);
    running
}

/// Waits for two more barriers: then ticks after the swap have certainly reached the sink.
pub fn wait_for_two_barriers(launch: &Launch) {
    launch.wait_for_barrier(launch.newest_barrier().expect("it runs") + 2);
}

/// Starts a swap, and returns when it has passed its check.
pub fn begin_swap(launch: &Launch, arguments: &[&str]) -> Child {
    let mut command = replica(launch, &[&["swap"], arguments].concat());
    let output_text = std::fs::File::create(launch.folder().join("swap.txt")).expect("created");
    let child = command.stdout(Stdio::piped()).stderr(output_text).spawn().expect("replica starts");
    wait_for("the drain", || swap_output(launch).contains("draining to a barrier").then_some(()));
    child
}

/// Messages of the swap of [`begin_swap`] so far.
pub fn swap_output(launch: &Launch) -> String {
    std::fs::read_to_string(launch.folder().join("swap.txt")).unwrap_or_default()
}
