//! Claims of the thesis, repeated on own data. Each prints one or two tables and takes minutes.
//! Results: `experiments/README.md`.
//!
//! `cargo run --release -p experiments -- mnist-binary` runs one; `--help` lists all.

mod height_slices;
mod loss_table;
mod mnist;
mod power_jaccard_minimum;
mod streets;

use clap::{Parser, ValueEnum};

/// Repeat a claim of the thesis on own data and print its table.
#[derive(Parser)]
#[command(name = "experiments")]
struct Args {
    /// The experiment
    #[arg(value_enum)]
    experiment: Experiment,
    /// Number of trainings per row; seed N of a training is N - 1
    #[arg(default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum Experiment {
    /// Minimum of the Power Jaccard loss of a pixel (section 5.5.3, figure 5.4); no data.
    Minimum,
    /// Losses on MNIST, digit or background (table 5.1); data: mnist/ of the real data.
    MnistBinary,
    /// Losses on MNIST, ten digits and background (table 5.2); data: mnist/ of the real data.
    MnistMulticlass,
    /// Losses on the low height slice (table 5.6); data: top views of simulated towns.
    SliceLow,
    /// Losses on the high height slice (table 5.7); data: top views of simulated towns.
    SliceHigh,
    /// Transfer to another sensor and kind of town (table 6.6); data: simulated sweeps.
    Transfer,
    /// Hierarchical loss (tables 6.9 and 6.10); data: simulated sweeps.
    Hierarchy,
    /// Models of fewer classes (table 6.8); data: simulated sweeps.
    Specialized,
    /// Color as an additional input (table 6.12); data: simulated sweeps.
    Color,
}

fn main() -> anyhow::Result<()> {
    let Args { experiment, seeds } = Args::parse();
    match experiment {
        Experiment::Minimum => {
            power_jaccard_minimum::run();
            Ok(())
        }
        Experiment::MnistBinary => mnist::run(true, seeds),
        Experiment::MnistMulticlass => mnist::run(false, seeds),
        Experiment::SliceLow => height_slices::run(height_slices::LOW, seeds),
        Experiment::SliceHigh => height_slices::run(height_slices::HIGH, seeds),
        Experiment::Transfer => streets::transfer::run(seeds),
        Experiment::Hierarchy => streets::hierarchy(seeds),
        Experiment::Specialized => streets::specialized(seeds),
        Experiment::Color => streets::color(seeds),
    }
}
