//! What the tests of swaps share: `replica swap` and `replica stop` against a run.

use crate::{Launch, Running, binary, said, wait_for};
use std::process::{Child, Command, Output, Stdio};

/// A command of `replica` about the run.
pub fn replica(launch: &Launch, arguments: &[&str]) -> Command {
    let mut command = Command::new(binary("replica"));
    command.args(arguments).arg("--run").arg(launch.output()).stdin(Stdio::null());
    command
}

/// `replica swap …` to its end.
pub fn swap(launch: &Launch, arguments: &[&str]) -> Output {
    replica(launch, &[&["swap"], arguments].concat()).output().expect("replica starts")
}

/// A swap that must succeed; what it says.
pub fn swapped(launch: &Launch, arguments: &[&str]) -> String {
    let output = swap(launch, arguments);
    assert!(output.status.success(), "{}", said(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// A swap that must be refused for reasons that hold `words`.
pub fn refused(launch: &Launch, arguments: &[&str], words: &[&str]) {
    let output = swap(launch, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", said(&output));
    for word in words.iter().chain(&["nothing was changed"]) {
        assert!(said(&output).contains(word), "{arguments:?}: {word:?} is not in:\n{}", said(&output));
    }
}

/// Drains the run; what `replica stop` says.
pub fn stop(launch: &Launch) -> String {
    let output = replica(launch, &["stop"]).output().expect("replica starts");
    assert!(output.status.success(), "{}", said(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// A run that has come to its first barrier.
pub fn started(launch: &Launch) -> Running {
    let running = launch.start();
    launch.wait_for_barrier(1);
    running
}

/// Lets the run come two barriers further: ticks after the swap have then surely reached the sink.
pub fn go_on(launch: &Launch) {
    launch.wait_for_barrier(launch.newest_barrier().expect("it runs") + 2);
}

/// Begins a swap, and returns when it has been found to fit.
pub fn begin_swap(launch: &Launch, arguments: &[&str]) -> Child {
    let mut command = replica(launch, &[&["swap"], arguments].concat());
    let said = std::fs::File::create(launch.folder().join("swap.txt")).expect("created");
    let child = command.stdout(Stdio::piped()).stderr(said).spawn().expect("replica starts");
    wait_for("the drain", || swap_said(launch).contains("draining to a barrier").then_some(()));
    child
}

/// What the swap of [`begin_swap`] has said so far.
pub fn swap_said(launch: &Launch) -> String {
    std::fs::read_to_string(launch.folder().join("swap.txt")).unwrap_or_default()
}
