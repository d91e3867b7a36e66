//! The data sets of the street experiments, and the trainings on them.

use super::sweep_images::{self, FOLD, N_INPUTS, N_INPUTS_WITH_COLOR, SensorScenario, SweepDataset, TownSweep};
use crate::loss_table::{Task, settings};
use messages::ClassId;
use scores::Confusion;
use segmentation::engine::Border;
use segmentation::network::NetworkSpec;
use std::ops::RangeInclusive;
use training::TrainSettings;
use training::{Hierarchy, Loss};

/// Sweeps for training, validation and testing.
pub struct StreetData {
    pub train: Vec<TownSweep>,
    validation: Vec<TownSweep>,
    test: Vec<TownSweep>,
}

impl StreetData {
    /// Simulates `n` sweeps of each training drive, and sweeps of fixed validation and test drives. The test drives are not used for
    /// training or validation.
    pub fn simulate(scenery: SensorScenario, seeds: RangeInclusive<u64>, n: usize) -> anyhow::Result<Self> {
        Ok(Self {
            train: sweep_images::simulate(scenery, seeds, n)?,
            validation: sweep_images::simulate(scenery, 2001..=2006, 2)?,
            test: sweep_images::simulate(scenery, 9501..=9508, 3)?,
        })
    }

    /// The data of tables 6.8 to 6.12.
    pub fn urban(with_color: bool) -> anyhow::Result<Self> {
        Self::simulate(SensorScenario { with_color, ..SensorScenario::URBAN }, 501..=520, 4)
    }

    /// Calls `f` with the task of distinguishing these classes, trained for `epochs` epochs.
    pub fn with_task<T>(
        &self,
        classes: &[ClassId],
        with_color: bool,
        epochs: usize,
        f: impl FnOnce(&Task<'_>) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let [train, validation, test] =
            [&self.train, &self.validation, &self.test].map(|sweeps| SweepDataset::new(sweeps, classes, with_color));
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

    /// The confusion matrix on the test set for each seed.
    pub fn confusions(
        &self,
        classes: &[ClassId],
        with_color: bool,
        (loss, hierarchy): (&Loss, bool),
        n_seeds: u64,
    ) -> anyhow::Result<Vec<Confusion>> {
        self.with_task(classes, with_color, 12, |task| task.confusions(loss, hierarchy, n_seeds))
    }
}
