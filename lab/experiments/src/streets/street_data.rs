//! The data sets of the street experiments.

use super::sweep_images::{self, FOLD, SensorScenario, SweepDataset, TownSweep};
use crate::task::{DataSets, Examples, Task};
use kernels::images::Border;
use messages::ClassId;
use simulation::Town;
use std::ops::RangeInclusive;
use std::sync::Arc;
use town_sweeps::Mount;
use training::{Dataset, Hierarchy};

/// Drives for validation; two sweeps of each.
pub const VALIDATION: RangeInclusive<u64> = 2001..=2006;
/// Drives that are only scored; three sweeps of each.
pub const TEST: RangeInclusive<u64> = 9501..=9508;
/// Sweeps of a training drive.
const N_SWEEPS: usize = 4;

/// Simulated sweeps to learn, to validate and to score.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreetData {
    /// Urban towns, the tilted HDL-32E of the L3D2 vehicle.
    Urban,
    /// Urban towns with colors, the sensor of the L3D2 vehicle.
    UrbanInColor,
    /// Urban towns, an upright HDL-64E as on KITTI's vehicle.
    UrbanUpright,
    /// Rural towns, the sensor of the L3D2 vehicle; number of drives to learn.
    Rural(u64),
}

impl StreetData {
    pub fn description(self) -> String {
        let name = match self {
            Self::Urban => "urban, HDL-32E",
            Self::UrbanInColor => "urban, HDL-32E, color",
            Self::UrbanUpright => "urban, upright HDL-64E",
            Self::Rural(_) => "rural, HDL-32E",
        };
        let train = self.train();
        format!(
            "{name}: {N_SWEEPS} sweeps each of drives {train:?} to learn, {VALIDATION:?} to validate, {TEST:?} to score"
        )
    }
    fn train(self) -> RangeInclusive<u64> {
        match self {
            Self::Rural(n_drives) => 601..=600 + n_drives,
            _ => 501..=520,
        }
    }
    fn scenario(self) -> SensorScenario {
        match self {
            Self::Urban => SensorScenario::URBAN,
            Self::UrbanInColor => SensorScenario { with_color: true, ..SensorScenario::URBAN },
            Self::UrbanUpright => SensorScenario { mount: Mount::KITTI, ..SensorScenario::URBAN },
            Self::Rural(_) => SensorScenario { town: Town::Rural, ..SensorScenario::URBAN },
        }
    }
    pub fn simulate(self) -> anyhow::Result<Sweeps> {
        let of = |seeds, n| Ok::<_, anyhow::Error>(Arc::new(sweep_images::simulate(self.scenario(), seeds, n)?));
        Ok(Sweeps {
            train: of(self.train(), N_SWEEPS)?,
            validation: of(VALIDATION, 2)?,
            test: of(TEST, 3)?,
            scene: if matches!(self, Self::Rural(_)) { "rural" } else { "urban" },
        })
    }
}

/// Simulated sweeps.
#[derive(Clone)]
pub struct Sweeps {
    train: Arc<Vec<TownSweep>>,
    validation: Arc<Vec<TownSweep>>,
    test: Arc<Vec<TownSweep>>,
    scene: &'static str,
}

impl Sweeps {
    /// The task of distinguishing these classes, with colors as input or without.
    pub fn task(&self, classes: &[ClassId], with_color: bool) -> Task {
        let data = |sweeps: &Arc<Vec<TownSweep>>| -> Box<dyn Dataset> {
            Box::new(SweepDataset::new(Arc::clone(sweeps), classes, with_color))
        };
        let sets = DataSets {
            train: data(&self.train),
            validation: data(&self.validation),
            tests: vec![(self.scene, data(&self.test))],
        };
        let examples = Examples::Images { sets, fold: FOLD, border: Border::Circular };
        Task { examples, n_classes: classes.len(), tree: Hierarchy::from_classes(classes) }
    }
}
