//! `replica-launch launch.toml`: see [`launch`].

use std::process::ExitCode;

fn main() -> ExitCode {
    run::process::with_enough_stack(launch::main)
}
