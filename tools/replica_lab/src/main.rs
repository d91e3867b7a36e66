//! `replica-lab`: trains models, scores results, measures cost and analyzes measurements.
//!
//! | module | commands |
//! |---|---|
//! | `train`, `fuse`, `nearest`, `materials` | `train`, `fuse`, `nearest`, `fit-materials`: models from recipes, models and libraries of spectra |
//! | `evaluate` | `evaluate`: runs, trajectories, maps, classes, instances, materials and projections against ground truth |
//! | `bench` | `bench`: throughput, CPU and memory of a launch file |
//! | `cube`, `spectrum` | `cube`, `spectrum`: reflectance cubes and their statistics, color lines and materials |
//!
//! It must never take part in a run. No stage and no command of `replica` needs it, so that a plain `cargo build`
//! leaves it out. It reads the files of finished runs and writes only to the folder of `--out`. Data goes to stdout,
//! diagnostics go to stderr.
//!
//! Start reading at `cli`, which lists the commands; a command is a file with its `Args` and a function `run`. The methods are in
//! libraries (`training`, `scores`, `spectral`, `color_lines`); this crate has files, tables and options.

mod bench;
mod cli;
mod cube;
mod evaluate;
mod fuse;
mod materials;
mod nearest;
mod recorded_classes;
mod sensor_calibration;
mod spectrum;
mod train;
mod true_points;

use std::process::ExitCode;

fn main() -> ExitCode {
    run::process::with_enough_stack(run_command)
}

fn run_command() -> ExitCode {
    command_line::threads::bound();
    command_line::exit_code::from_result(cli::parse().run())
}
