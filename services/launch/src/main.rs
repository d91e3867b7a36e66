//! `replica-launch launch.toml`: see [`launch`].

use std::process::ExitCode;

fn main() -> ExitCode {
    launch::main()
}
