//! `replica-ros2`: takes images, samples, positions and packets from a running ROS 2 into a live run.

mod arguments;
mod bridge;
mod choice;
mod counts;
mod feed;
mod names;
mod roles;
mod sinks;
mod subscription;

use arguments::Args;
use std::process::ExitCode;

/// Exit code of a bridge that left out messages.
const INCOMPLETE: u8 = 3;

fn main() -> ExitCode {
    match bridge::run(&Args::read()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(INCOMPLETE),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
