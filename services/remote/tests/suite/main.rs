//! The program by itself.

use std::process::Command;

#[test]
fn program_without_a_run_says_what_starts_it() {
    let output = Command::new(env!("CARGO_BIN_EXE_replica-remote")).output().expect("starts");
    let text = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("`host`") && text.contains("replica-launch"), "{text}");
}
