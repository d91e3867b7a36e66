//! Experiments: claims of the thesis, repeated on own data. One command for each table: `cargo run --release -p experiments -- TABLE`
//! runs the unfinished trainings and prints the table; `--help` lists all tables. Results and conclusions:
//! `lab/experiments/README.md`.
//!
//! | idea | module |
//! |---|---|
//! | a table as a grid of trainings; running it, alone or as one of several jobs | `experiment`, `task` |
//! | a training and its result | `one_training`, `outcome`, `recipe` |
//! | results on disk, published ones first | `store` |
//! | losses and height slices (chapter 5) | `loss_table`, `mnist`, `height_slices`, `power_jaccard_minimum` |
//! | streets (chapter 6): perspectives, transfer, color | `streets` |
//! | color lines (chapter 3) | `color_lines` |
//!
//! An experiment must never change a model or a default of the product, or read held-out seeds for a choice. An interrupted
//! training continues, and finished trainings are not repeated: the same table gives the same bytes on one machine.
//!
//! Start reading at `Table` below, which lists the tables; `experiment::run` runs one.

mod color_lines;
mod experiment;
mod height_slices;
mod loss_table;
mod mnist;
mod one_training;
mod outcome;
mod power_jaccard_minimum;
mod recipe;
mod statistics;
mod store;
mod streets;
mod task;
#[cfg(test)]
mod tests;

use anyhow::ensure;
use clap::{Parser, ValueEnum};
use experiment::{Experiment, Job, print_plan, run};
use one_training::Budget;
use std::path::PathBuf;
use store::Store;
use streets::{StreetTable, Streets};

/// Repeat a claim of the thesis on own data and print its table.
#[derive(Parser)]
#[command(name = "experiments")]
struct Args {
    /// The table; with --plan, all tables if none is named
    #[arg(value_enum, required_unless_present = "plan")]
    table: Option<Table>,
    /// Trainings per cell; seed N of a training is N - 1 [default: 3, 5]
    seeds: Option<u64>,
    /// Folder of results and checkpoints; a second start continues
    #[arg(long, default_value = "out/experiments")]
    out: PathBuf,
    /// Folder of published results, one file for each table; their trainings are not repeated
    #[arg(long, default_value = "lab/experiments/results")]
    published: PathBuf,
    /// CPU hours after which training stops with a checkpoint
    #[arg(long)]
    budget_hours: Option<f64>,
    /// Part I of N of the trainings, for example 2/4
    #[arg(long, default_value = "1/1")]
    job: Job,
    /// Threads; results do not depend on their number
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Images, folder of BSDS500, or cubes for the tables of chapter 3 [default: from the data folder]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    input: Vec<PathBuf>,
    /// Use only the first N images of BSDS500
    #[arg(long, value_name = "N")]
    limit: Option<usize>,
    /// Print only the number of trainings and their CPU hours
    #[arg(long)]
    plan: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Table {
    /// Straight and graph-based color lines of images (table 3.1, figure 3.11)
    ColorLines,
    /// Regions of Gaussians and SLIC on BSDS500 (tables 3.3, 3.4)
    Superpixels,
    /// Gaussians of hyperspectral cubes (tables 3.5, 3.6)
    Cubes,
    /// Minimum of the Power Jaccard loss (section 5.5.3); no data
    Minimum,
    /// Losses on MNIST, digit or background (table 5.1)
    MnistBinary,
    /// Losses on MNIST, ten digits and background (table 5.2)
    MnistMulticlass,
    /// Losses on the low height slice (table 5.6)
    SliceLow,
    /// Losses on the high height slice (table 5.7)
    SliceHigh,
    /// Scores by class in two kinds of towns (form of tables 6.4, 6.5)
    Towns,
    /// Transfer to another sensor and kind of town (tables 6.6, 6.7)
    Transfer,
    /// Models of fewer classes (table 6.8)
    Specialized,
    /// Hierarchical loss (tables 6.9, 6.10)
    Hierarchy,
    /// Color as an additional input (table 6.12), range images
    Color,
    /// Color as an additional input (table 6.12), points
    ColorPoints,
    /// Curriculum, and a class tree grown from confusions (section 7.3)
    Perspectives,
}

impl Table {
    /// The experiment, and its number of seeds. `None`: nothing is trained.
    fn experiment(self) -> Option<(Box<dyn Experiment>, u64)> {
        Some(match self {
            Self::ColorLines | Self::Superpixels | Self::Cubes | Self::Minimum => return None,
            Self::MnistBinary => (Box::new(mnist::Mnist { is_binary: true }), 5),
            Self::MnistMulticlass => (Box::new(mnist::Mnist { is_binary: false }), 5),
            Self::SliceLow => (Box::new(height_slices::LOW), 5),
            Self::SliceHigh => (Box::new(height_slices::HIGH), 5),
            Self::Towns => (Box::new(StreetTable::towns()), 3),
            Self::Transfer => (Box::new(streets::transfer::Transfer(Streets::default())), 3),
            Self::Specialized => (Box::new(StreetTable::specialized()), 3),
            Self::Hierarchy => (Box::new(StreetTable::hierarchy()), 3),
            Self::Color => (Box::new(StreetTable::color()), 3),
            Self::ColorPoints => (Box::new(streets::color_of_points::ColorOfPoints::default()), 3),
            Self::Perspectives => (Box::new(streets::perspectives::Perspectives(Streets::default())), 3),
        })
    }
}

fn main() -> anyhow::Result<()> {
    allocator::restart_with_kept_memory(allocator::Keep::Large);
    let Args { table, seeds, out, published, budget_hours, job, threads, input, limit, plan } = Args::parse();
    // Seeds of 9000 and above are for test drives only.
    ensure!(seeds.is_none_or(|seeds| (1..=1000).contains(&seeds)), "the number of seeds must be 1 to 1000");
    ensure!(budget_hours.is_none_or(|hours| hours >= 0.0), "--budget-hours must be at least 0");
    let of_table = |table: Table| -> anyhow::Result<()> {
        let Some((experiment, default_seeds)) = table.experiment() else {
            return match table {
                _ if plan => Ok(()),
                Table::ColorLines => color_lines::lines(&input),
                Table::Superpixels => color_lines::superpixels(&input, limit),
                Table::Cubes => color_lines::cubes(&input),
                _ => {
                    power_jaccard_minimum::run();
                    Ok(())
                }
            };
        };
        let seeds = seeds.unwrap_or(default_seeds);
        let name = experiment.name();
        let store = Store::with_published(out.join(name), &published.join(format!("{name}.jsonl")))?;
        if plan {
            return print_plan(experiment.as_ref(), &experiment.recipes(seeds), &store);
        }
        run(experiment.as_ref(), &store, seeds, &Budget::new(budget_hours), job)
    };
    // Inside the pool: a call from outside waits for another thread several times per step.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let tables = table.map_or_else(|| Table::value_variants().to_vec(), |table| vec![table]);
    pool.install(|| tables.into_iter().try_for_each(of_table))
}
