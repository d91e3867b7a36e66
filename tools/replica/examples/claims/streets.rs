//! Tables 6.6, 6.8, 6.9, 6.10 and 6.12 on sweeps of simulated towns: a small U-Net on range images in place of the thesis' `KPConv`.

mod surfaces;
mod sweeps;
pub mod transfer;

use crate::training::{Task, mean_and_deviation, range, settings};
use learning::engine::Border;
use learning::losses::{Hierarchy, Loss};
use learning::network::NetworkSpec;
use learning::scores::Confusion;
use learning::training::TrainSettings;
use messages::ClassId::{
    self, Building, Fence, Pedestrian, Pole, Road, RoadLine, Sidewalk, Static, Terrain, TrafficLight, TrafficSign,
    Vegetation, Vehicles, Wall,
};
use std::ops::RangeInclusive;
use sweeps::{FOLD, N_INPUTS, N_INPUTS_WITH_COLOR, Scenery, TownSweep, View};

/// All classes of table 6.8 and walls, which towns have more of than Paris.
const ALL: [ClassId; 14] = [
    Fence,
    Pedestrian,
    Pole,
    Vegetation,
    Vehicles,
    Wall,
    TrafficSign,
    TrafficLight,
    Static,
    Building,
    RoadLine,
    Road,
    Sidewalk,
    Terrain,
];
/// Without ground.
const M2: &[ClassId] = ALL.split_at(10).0;
/// Without ground and buildings.
const M3: &[ClassId] = ALL.split_at(9).0;

const POWER_2: Loss = Loss::PowerJaccard { power: 2.0 };
const CE_AND_POWER_2: Loss = Loss::CrossEntropyPowerJaccard { power: 2.0 };

struct Data {
    train: Vec<TownSweep>,
    validation: Vec<TownSweep>,
    test: Vec<TownSweep>,
}

impl Data {
    /// `n` sweeps of each of some drives to learn from; seeds of 9000 and above are for tests alone.
    fn cast(scenery: Scenery, seeds: RangeInclusive<u64>, n: usize) -> anyhow::Result<Self> {
        Ok(Self {
            train: sweeps::cast(scenery, seeds, n)?,
            validation: sweeps::cast(scenery, 2001..=2006, 2)?,
            test: sweeps::cast(scenery, 9501..=9508, 3)?,
        })
    }

    /// The set of tables 6.8 to 6.12.
    fn urban(with_color: bool) -> anyhow::Result<Self> {
        Self::cast(Scenery { with_color, ..Scenery::URBAN }, 501..=520, 4)
    }

    /// Has `f` do something with the task of telling these classes apart in so many passes.
    fn with_task<T>(
        &self,
        classes: &[ClassId],
        with_color: bool,
        epochs: usize,
        f: impl FnOnce(&Task<'_>) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let [train, validation, test] =
            [&self.train, &self.validation, &self.test].map(|sweeps| View::of(sweeps, classes, with_color));
        f(&Task {
            train: &train,
            validation: &validation,
            test: &test,
            spec: NetworkSpec::Unet {
                inputs: if with_color { N_INPUTS_WITH_COLOR } else { N_INPUTS },
                outputs: FOLD * classes.len(),
                widths: vec![16, 24, 32],
                head: None,
            },
            shape: (classes.len(), FOLD),
            border: Border::Circular,
            tree: Hierarchy::of_classes(classes),
            settings: TrainSettings { average: 0.95, pixels: 12_000, patience: 100, ..settings(epochs, 2, 4e-3) },
        })
    }

    /// The confusion on the test set by seed.
    fn confusions(
        &self,
        classes: &[ClassId],
        with_color: bool,
        (loss, hierarchy): (&Loss, bool),
        n_seeds: u64,
    ) -> anyhow::Result<Vec<Confusion>> {
        self.with_task(classes, with_color, 12, |task| task.confusions(loss, hierarchy, n_seeds))
    }
}

/// A way of training and its confusion by seed.
type Column<'a> = (&'a str, &'a [ClassId], Vec<Confusion>);

/// IoU by class in percent, mean and range over the seeds; below, the same of the mean over the classes that each learned, over the
/// `shared` ones, and of the overall accuracy.
fn write_table(columns: &[Column<'_>], shared: &[ClassId]) {
    let names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
    println!("| class | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
    let text = |values: &[f64]| {
        let percents: Vec<f64> = values.iter().map(|value| 100.0 * value).collect();
        let [least, largest] = range(&percents);
        format!("{:.1} ({least:.1} to {largest:.1})", mean_and_deviation(&percents).0)
    };
    let iou = |confusion: &Confusion, classes: &[ClassId], class: ClassId| {
        let index = classes.iter().position(|of| *of == class)?;
        confusion.class(index).iou.filter(|_| confusion.class(index).n_truth > 0)
    };
    let row = |name: &str, value: &dyn Fn(&Confusion, &[ClassId]) -> Option<f64>| {
        let cells = columns.iter().map(|(_, classes, confusions)| {
            let values: Option<Vec<f64>> = confusions.iter().map(|confusion| value(confusion, classes)).collect();
            values.map_or_else(|| "-".to_owned(), |values| text(&values))
        });
        println!("| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
    };
    for class in ALL {
        row(class.name(), &|confusion, classes| iou(confusion, classes, class));
    }
    row("mean of learned", &|confusion, _| confusion.mean_iou());
    if shared.len() < ALL.len() {
        row(&format!("mean of {}", shared.len()), &|confusion, classes| {
            let ious: Vec<f64> = shared.iter().filter_map(|class| iou(confusion, classes, *class)).collect();
            (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
        });
    }
    row("OA", &|confusion, _| confusion.overall_accuracy());
}

/// Tables 6.9 and 6.10.
pub fn hierarchy(n_seeds: u64) -> anyhow::Result<()> {
    let data = Data::urban(false)?;
    let column = |name, loss, hierarchy| -> anyhow::Result<Column<'_>> {
        Ok((name, &ALL, data.confusions(&ALL, false, (loss, hierarchy), n_seeds)?))
    };
    let columns = [
        column("CE", &Loss::CrossEntropy, false)?,
        column("CE + Jac. 2", &CE_AND_POWER_2, false)?,
        column("Jac. 2", &POWER_2, false)?,
        column("hierarchical Jac. 2", &POWER_2, true)?,
    ];
    write_table(&columns, &ALL);
    let percents =
        |column: &Column<'_>| column.2.iter().map(|c| 100.0 * c.mean_iou().unwrap_or(0.0)).collect::<Vec<_>>();
    let gains: Vec<f64> =
        percents(&columns[3]).iter().zip(percents(&columns[2])).map(|(with, flat)| with - flat).collect();
    let (mean, deviation) = mean_and_deviation(&gains);
    let error = deviation / (gains.len() as f64 - 1.0).sqrt();
    println!("\nGain of the hierarchy by seed: {gains:.1?}, mean {mean:.1} with a standard error of {error:.1}");
    Ok(())
}

/// Table 6.8.
pub fn specialized(n_seeds: u64) -> anyhow::Result<()> {
    let data = Data::urban(false)?;
    let column = |name, classes| -> anyhow::Result<Column<'_>> {
        Ok((name, classes, data.confusions(classes, false, (&CE_AND_POWER_2, false), n_seeds)?))
    };
    write_table(&[column("M1", &ALL)?, column("M2", M2)?, column("M3", M3)?], M3);
    Ok(())
}

/// Table 6.12, column P3, with cross-entropy beside the thesis' Jac. 2: alone that learns too little in trainings this short.
pub fn color(n_seeds: u64) -> anyhow::Result<()> {
    let data = Data::urban(true)?;
    let column = |name, with_color| -> anyhow::Result<Column<'_>> {
        Ok((name, &ALL, data.confusions(&ALL, with_color, (&CE_AND_POWER_2, false), n_seeds)?))
    };
    write_table(&[column("geometry", false)?, column("geometry and RGB", true)?], &ALL);
    Ok(())
}
