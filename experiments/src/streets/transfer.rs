//! Table 6.6: transfer of a model to another sensor and another kind of town.

use super::CE_AND_POWER_2;
use super::iou_table::{ALL, Column, print_iou_table};
use super::street_data::StreetData;
use super::sweep_images::SensorScenario;
use crate::loss_table::{Task, mean_and_deviation};
use scores::Confusion;
use segmentation::network::Weights;
use simulation::Town;
use town_sweeps::Mount;
use training::Variables;
use training::{TrainSettings, Trainer};

/// An upright HDL-64E, mounted as KITTI's.
const SOURCE: SensorScenario = SensorScenario { mount: Mount::Kitti, ..SensorScenario::URBAN };
/// The tilted HDL-32E of the L3D2 vehicle.
const TARGET: SensorScenario = SensorScenario { town: Town::Rural, ..SensorScenario::URBAN };

/// A method to train a model for the target.
struct Method {
    name: &'static str,
    /// Whether it starts from the weights of the source.
    is_transferred: bool,
    /// Name prefixes of variables that are not trained. `None`: no training.
    frozen: Option<&'static [&'static str]>,
}

const METHODS: [Method; 5] = [
    Method { name: "no fine-tuning", is_transferred: true, frozen: None },
    Method { name: "last layer", is_transferred: true, frozen: Some(&["down.", "up."]) },
    Method { name: "frozen features", is_transferred: true, frozen: Some(&["down."]) },
    Method { name: "nothing frozen", is_transferred: true, frozen: Some(&[]) },
    Method { name: "no transfer", is_transferred: false, frozen: Some(&[]) },
];

/// Number of training drives of the target, with four sweeps each, and number of epochs: 240 and 480 steps.
const TARGETS: [(u64, usize); 2] = [(2, 60), (20, 12)];

/// Prints table 6.6.
pub fn run(n_seeds: u64) -> anyhow::Result<()> {
    let source = StreetData::simulate(SOURCE, 501..=520, 4)?;
    let learn = |task: &Task<'_>| -> anyhow::Result<Vec<Weights>> {
        let of_seed =
            |seed| Ok(task.trained(settings(task, seed), Variables::random(&task.spec, seed)?, &[])?.best().clone());
        (0..n_seeds).map(of_seed).collect()
    };
    let sources = source.with_task(&ALL, false, 12, learn)?;
    for (n_drives, epochs) in TARGETS {
        let target = StreetData::simulate(TARGET, 601..=600 + n_drives, 4)?;
        println!("{} sweeps:\n", target.train.len());
        target.with_task(&ALL, false, epochs, |task| table(task, &sources))?;
        println!();
    }
    Ok(())
}

fn settings(task: &Task<'_>, seed: u64) -> TrainSettings {
    TrainSettings { seed, loss: CE_AND_POWER_2, ..task.settings.clone() }
}

/// Prints one column per method. The last row is the epoch with the best validation.
fn table(task: &Task<'_>, sources: &[Weights]) -> anyhow::Result<()> {
    let (mut columns, mut passes): (Vec<Column<'_>>, Vec<String>) = (Vec::new(), Vec::new());
    for Method { name, is_transferred, frozen } in METHODS {
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
    print_iou_table(&columns, &ALL);
    println!("| best epoch | {} |", passes.join(" | "));
    Ok(())
}
