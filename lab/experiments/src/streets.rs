//! Tables 6.4 to 6.12 in simulated towns: with a small U-Net on range images, and table 6.12 also with a network on points.

mod classes;
pub mod color_of_points;
mod ideal_colors;
mod iou_table;
pub mod perspectives;
mod street_data;
mod sweep_images;
mod town_spheres;
pub mod transfer;

use crate::experiment::{Experiment, Results};
use crate::loss_table::{OVER_THE_TREE, loss};
use crate::recipe::{Architecture, Recipe, settings};
use crate::statistics::mean_and_deviation;
use crate::task::Task;
use anyhow::Context;
use classes::{ALL, NO_GROUND, NO_GROUND_AND_BUILDINGS};
use iou_table::{columns, iou_table, precision_table};
use messages::ClassId;
use segmentation::network::NetworkSpec;
use std::cell::RefCell;
use std::fmt::Write;
use street_data::{StreetData, Sweeps};
use sweep_images::{FOLD, N_INPUTS, N_INPUTS_WITH_COLOR};
use training::TrainSettings;

/// CPU seconds of a training on 80 sweeps until convergence: measured 1.8 s per epoch, times an estimate of 40 epochs.
const CPU_SECONDS: f64 = 75.0;

const HIERARCHICAL: &str = "hierarchical Jac. 2";

/// The recipe of a kind of training.
fn recipe(kind: &Kind<'_>, seed: u64) -> Recipe {
    let &Kind { row, column, data, classes } = kind;
    let n_inputs = if data == StreetData::UrbanInColor { N_INPUTS_WITH_COLOR } else { N_INPUTS };
    let outputs = FOLD * classes.len();
    let widths = vec![16, 24, 32];
    Recipe {
        row: row.to_owned(),
        column: column.to_owned(),
        data: format!("{}; {} classes", data.description(), classes.len()),
        network: Architecture::Images(NetworkSpec::Unet { inputs: n_inputs, outputs, widths, head: None }),
        frozen: Vec::new(),
        start: None,
        tree_of: None,
        settings: TrainSettings {
            average: 0.95,
            pixels: 12_000,
            hierarchy: row.starts_with(OVER_THE_TREE),
            ..settings(2, 4e-3, loss(row), seed)
        },
    }
}

/// The simulated sweeps that were used last: the tables use the same sweeps for several sets of classes.
#[derive(Default)]
pub struct Streets(RefCell<Option<(StreetData, Sweeps)>>);

impl Streets {
    /// The task of a recipe whose data are one of `all`.
    fn load(
        &self,
        recipe: &Recipe,
        all: impl IntoIterator<Item = StreetData>,
        classes: &[ClassId],
    ) -> anyhow::Result<Task> {
        let data = all.into_iter().find(|data| recipe.data.starts_with(&data.description()));
        let data = data.with_context(|| format!("no data of this experiment: {}", recipe.data))?;
        let mut last = self.0.borrow_mut();
        if last.as_ref().is_none_or(|(of, _)| *of != data) {
            *last = Some((data, data.simulate()?));
        }
        let (_, sweeps) = last.as_ref().context("sweeps are simulated above")?;
        Ok(sweeps.task(classes, data == StreetData::UrbanInColor))
    }
}

/// One kind of training of a table.
#[derive(Clone, Copy)]
struct Kind<'a> {
    /// Loss.
    row: &'a str,
    column: &'a str,
    data: StreetData,
    classes: &'a [ClassId],
}

impl<'a> Kind<'a> {
    const fn new(row: &'a str, column: &'a str, data: StreetData, classes: &'a [ClassId]) -> Self {
        Self { row, column, data, classes }
    }
}

/// A table of trainings that differ in losses, classes or color.
pub struct StreetTable {
    name: &'static str,
    kinds: &'static [Kind<'static>],
    table: fn(&Results) -> String,
    streets: Streets,
}

impl StreetTable {
    /// Tables 6.4 and 6.5 in form: training and test in urban and in rural towns.
    pub fn towns() -> Self {
        const KINDS: [Kind<'static>; 2] = [
            Kind::new("CE + Jac. 2", "urban", StreetData::Urban, &ALL),
            Kind::new("CE + Jac. 2", "rural", StreetData::Rural(20), &ALL),
        ];
        let table = |results: &Results| precision_table(&columns(results, |recipe| Some(recipe.column.clone())));
        Self { name: "towns", kinds: &KINDS, table, streets: Streets::default() }
    }
    /// Table 6.8.
    pub fn specialized() -> Self {
        const KINDS: [Kind<'static>; 3] = [
            Kind::new("CE + Jac. 2", "M1", StreetData::Urban, &ALL),
            Kind::new("CE + Jac. 2", "M2", StreetData::Urban, NO_GROUND),
            Kind::new("CE + Jac. 2", "M3", StreetData::Urban, NO_GROUND_AND_BUILDINGS),
        ];
        let table = |results: &Results| {
            iou_table(&columns(results, |recipe| Some(recipe.column.clone())), NO_GROUND_AND_BUILDINGS.len())
        };
        Self { name: "specialized", kinds: &KINDS, table, streets: Streets::default() }
    }
    /// Tables 6.9 and 6.10.
    pub fn hierarchy() -> Self {
        const KINDS: [Kind<'static>; 4] = [
            Kind::new("CE", "losses", StreetData::Urban, &ALL),
            Kind::new("CE + Jac. 2", "losses", StreetData::Urban, &ALL),
            Kind::new("Jac. 2", "losses", StreetData::Urban, &ALL),
            Kind::new(HIERARCHICAL, "losses", StreetData::Urban, &ALL),
        ];
        Self { name: "hierarchy", kinds: &KINDS, table: hierarchy_table, streets: Streets::default() }
    }
    /// Table 6.12.
    pub fn color() -> Self {
        const KINDS: [Kind<'static>; 8] = [
            Kind::new("Jac. 2", "P1", StreetData::Urban, NO_GROUND_AND_BUILDINGS),
            Kind::new("Jac. 2", "P2", StreetData::Urban, NO_GROUND),
            Kind::new("Jac. 2", "P3", StreetData::Urban, &ALL),
            Kind::new(HIERARCHICAL, "P4", StreetData::Urban, &ALL),
            Kind::new("Jac. 2", "P1 RGB", StreetData::UrbanInColor, NO_GROUND_AND_BUILDINGS),
            Kind::new("Jac. 2", "P2 RGB", StreetData::UrbanInColor, NO_GROUND),
            Kind::new("Jac. 2", "P3 RGB", StreetData::UrbanInColor, &ALL),
            Kind::new(HIERARCHICAL, "P4 RGB", StreetData::UrbanInColor, &ALL),
        ];
        let table = |results: &Results| iou_table(&columns(results, |recipe| Some(recipe.column.clone())), ALL.len());
        Self { name: "color", kinds: &KINDS, table, streets: Streets::default() }
    }
}

impl Experiment for StreetTable {
    fn name(&self) -> &'static str {
        self.name
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        // All seeds of a kind in turn: only the sweeps that were used last are kept.
        self.kinds.iter().flat_map(|kind| (0..n_seeds).map(move |seed| recipe(kind, seed))).collect()
    }
    fn load(&self, recipe: &Recipe) -> anyhow::Result<Task> {
        let kind = self.kinds.iter().find(|kind| recipe.row == kind.row && recipe.column == kind.column);
        let kind = kind.with_context(|| format!("no training of this table: {}", recipe.name()))?;
        self.streets.load(recipe, [kind.data], kind.classes)
    }
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        CPU_SECONDS
    }
    fn table(&self, results: &Results) -> String {
        (self.table)(results)
    }
}

/// The losses, and the gain of the hierarchical loss over the same loss without hierarchy.
fn hierarchy_table(results: &Results) -> String {
    let mut text = iou_table(&columns(results, |recipe| Some(recipe.row.clone())), ALL.len());
    let percent = |row: &str, seed: u64| {
        let found = results.iter().find(|(recipe, _)| recipe.row == row && recipe.settings.seed == seed);
        found.map(|(_, outcome)| 100.0 * outcome.mean_iou())
    };
    let seeds = results.iter().filter(|(recipe, _)| recipe.row == HIERARCHICAL).map(|(recipe, _)| recipe.settings.seed);
    let gains: Vec<f64> =
        seeds.filter_map(|seed| Some(percent(HIERARCHICAL, seed)? - percent("Jac. 2", seed)?)).collect();
    if gains.len() > 1 {
        let (mean, deviation) = mean_and_deviation(&gains);
        let error = deviation / (gains.len() as f64 - 1.0).sqrt();
        let _ =
            writeln!(text, "\nGain of the hierarchy by seed: {gains:.1?}, mean {mean:.1}, standard error {error:.1}");
    }
    text
}
