//! Table 6.6: what a model of one sensor in one kind of town is worth to another sensor in another kind.

use super::sweeps::Scenery;
use super::{ALL, CE_AND_POWER_2, Column, Data, write_table};
use crate::training::{Task, mean_and_deviation};
use learning::network::{Variables, Weights};
use learning::scores::Confusion;
use learning::training::{TrainSettings, Trainer};
use replica::town_sweeps::Mount;
use simulation::Town;

/// An HDL-64E upright on a roof, as KITTI's.
const SOURCE: Scenery = Scenery { mount: Mount::Kitti, ..Scenery::URBAN };
/// The tilted HDL-32E of the L3D2 vehicle.
const TARGET: Scenery = Scenery { town: Town::Rural, ..Scenery::URBAN };

/// A way to make a model of the target.
struct Mode {
    name: &'static str,
    /// Whether it begins with the source's weights.
    is_transferred: bool,
    /// The variables that stay as they are; `None` if nothing is learned.
    frozen: Option<&'static [&'static str]>,
}

const MODES: [Mode; 5] = [
    Mode { name: "no fine-tuning", is_transferred: true, frozen: None },
    Mode { name: "last layer", is_transferred: true, frozen: Some(&["down.", "up."]) },
    Mode { name: "frozen features", is_transferred: true, frozen: Some(&["down."]) },
    Mode { name: "nothing frozen", is_transferred: true, frozen: Some(&[]) },
    Mode { name: "no transfer", is_transferred: false, frozen: Some(&[]) },
];

/// Drives of the target to learn from, and passes over their four sweeps each: 240 and 480 steps.
const TARGETS: [(u64, usize); 2] = [(2, 60), (20, 12)];

/// Table 6.6.
pub fn run(n_seeds: u64) -> anyhow::Result<()> {
    let source = Data::cast(SOURCE, 501..=520, 4)?;
    let learn = |task: &Task<'_>| -> anyhow::Result<Vec<Weights>> {
        let of_seed =
            |seed| Ok(task.trained(settings(task, seed), Variables::random(&task.spec, seed)?, &[])?.best().clone());
        (0..n_seeds).map(of_seed).collect()
    };
    let sources = source.with_task(&ALL, false, 12, learn)?;
    for (n_drives, epochs) in TARGETS {
        let target = Data::cast(TARGET, 601..=600 + n_drives, 4)?;
        println!("{} sweeps:\n", target.train.len());
        target.with_task(&ALL, false, epochs, |task| table(task, &sources))?;
        println!();
    }
    Ok(())
}

fn settings(task: &Task<'_>, seed: u64) -> TrainSettings {
    TrainSettings { seed, loss: CE_AND_POWER_2, ..task.settings.clone() }
}

/// One column for each way to go on; below, the passes after which validation was best.
fn table(task: &Task<'_>, sources: &[Weights]) -> anyhow::Result<()> {
    let (mut columns, mut passes): (Vec<Column<'_>>, Vec<String>) = (Vec::new(), Vec::new());
    for Mode { name, is_transferred, frozen } in MODES {
        let of_seed = |(seed, source): (u64, &Weights)| -> anyhow::Result<(Confusion, f64)> {
            let variables = if is_transferred {
                Variables::from_weights(&task.spec, source)?
            } else {
                Variables::random(&task.spec, seed)?
            };
            let trainer = match frozen {
                Some(frozen) => task.trained(settings(task, seed), variables, frozen)?,
                None => Trainer::new(settings(task, seed), variables, task.shape, task.border, task.tree.clone())?,
            };
            let (_, confusion) = trainer.best_trainer()?.evaluate(task.test)?;
            Ok((confusion, trainer.curves().best().map_or(0.0, |(epoch, _)| 1.0 + epoch as f64)))
        };
        let results = (0..).zip(sources).map(of_seed).collect::<anyhow::Result<Vec<_>>>()?;
        let (confusions, best): (Vec<Confusion>, Vec<f64>) = results.into_iter().unzip();
        passes.push(format!("{:.1}", mean_and_deviation(&best).0));
        columns.push((name, &ALL, confusions));
        eprintln!("{name} is done");
    }
    write_table(&columns, &ALL);
    println!("| best after passes | {} |", passes.join(" | "));
    Ok(())
}
