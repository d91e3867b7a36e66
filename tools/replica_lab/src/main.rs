//! `replica-lab`: trains models, scores results and analyzes measurements. Data goes to stdout, diagnostics go to stderr.

mod bench;
mod cli;
mod cube;
mod evaluate;
mod fuse;
mod materials;
mod recorded_classes;
mod sensor_calibration;
mod spectrum;
mod train;
mod true_points;

use std::process::ExitCode;

fn main() -> ExitCode {
    command_line::exit_code::of_result(cli::parse().run())
}
