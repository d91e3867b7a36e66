//! `replica-lab`: trains models, scores results, measures cost and analyzes measurements.
//!
//! | module | commands |
//! |---|---|
//! | `train`, `fuse`, `materials` | `train`, `fuse`, `fit-materials`: models from recipes, models and libraries of spectra |
//! | `evaluate` | `evaluate`: runs, trajectories, maps, classes, instances, materials and projections against ground truth |
//! | `bench` | `bench`: throughput, CPU and memory of a launch file |
//! | `cube`, `spectrum` | `cube`, `spectrum`: reflectance cubes and their statistics, color lines and materials |
//!
//! What it must never do: take part in a run. No stage and no command of `replica` needs it, so that a plain `cargo build`
//! leaves it out. It reads files that a run has left, and writes only where `--out` says. Data goes to stdout,
//! diagnostics go to stderr.
//!
//! Where to begin reading: `cli` has the list of commands; a command is a file with its `Args` and a function `run`. The methods are in
//! libraries (`training`, `scores`, `spectral`, `color_lines`); here are files, tables and options.

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
