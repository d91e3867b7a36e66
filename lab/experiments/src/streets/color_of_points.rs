//! Table 6.12 with a network on points: `WaffleIron` instead of `KPConv`.

use super::HIERARCHICAL;
use super::classes::{ALL, NO_GROUND, NO_GROUND_AND_BUILDINGS};
use super::iou_table::{columns, iou_table};
use super::town_spheres::{RADIUS_M, TownClouds, description, features};
use crate::experiment::{Experiment, Results};
use crate::loss_table::loss;
use crate::recipe::{Architecture, Recipe, settings};
use crate::task::Task;
use anyhow::Context;
use messages::ClassId;
use segmentation::points::{PlaneConvolution, PointFeature, PointNetworkSpec, WaffleIron};
use std::cell::OnceCell;
use training::TrainSettings;

/// Column, loss, classes, and whether colors are an input.
const KINDS: [(&str, &str, &[ClassId], bool); 8] = [
    ("P1", "Jac. 2", NO_GROUND_AND_BUILDINGS, false),
    ("P2", "Jac. 2", NO_GROUND, false),
    ("P3", "Jac. 2", &ALL, false),
    ("P4", HIERARCHICAL, &ALL, false),
    ("P1 RGB", "Jac. 2", NO_GROUND_AND_BUILDINGS, true),
    ("P2 RGB", "Jac. 2", NO_GROUND, true),
    ("P3 RGB", "Jac. 2", &ALL, true),
    ("P4 RGB", HIERARCHICAL, &ALL, true),
];

/// Table 6.12 on points. The submaps are simulated once.
#[derive(Default)]
pub struct ColorOfPoints(OnceCell<TownClouds>);

impl Experiment for ColorOfPoints {
    fn name(&self) -> &'static str {
        "color-points"
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let recipe = |(column, row, classes, with_color): (&str, &str, &[ClassId], bool), seed: u64| {
            let color = if with_color { ", colors are an input" } else { "" };
            Recipe {
                row: row.to_owned(),
                column: column.to_owned(),
                data: format!("{}; {} classes{color}", description(), classes.len()),
                network: Architecture::Points(network(classes.len(), with_color)),
                frozen: Vec::new(),
                start: None,
                tree_of: None,
                settings: TrainSettings {
                    average: 0.95,
                    fixed_statistics: 0.3,
                    hierarchy: row == HIERARCHICAL,
                    ..settings(2, 4e-3, loss(row), seed)
                },
            }
        };
        KINDS.into_iter().flat_map(|kind| (0..n_seeds).map(move |seed| recipe(kind, seed))).collect()
    }
    fn load(&self, recipe: &Recipe) -> anyhow::Result<Task> {
        let kind = KINDS.into_iter().find(|(column, ..)| recipe.column == *column);
        let (_, _, classes, with_color) =
            kind.with_context(|| format!("no training of this table: {}", recipe.name()))?;
        if self.0.get().is_none() {
            // No other code sets it.
            let _ = self.0.set(TownClouds::simulate()?);
        }
        self.0.get().context("submaps are simulated above")?.task(classes, with_color)
    }
    /// A rough estimate.
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        200.0
    }
    fn table(&self, results: &Results) -> String {
        iou_table(&columns(results, |recipe| Some(recipe.column.clone())), ALL.len())
    }
}

fn network(outputs: usize, with_color: bool) -> PointNetworkSpec {
    PointNetworkSpec::WaffleIron(WaffleIron {
        inputs: PointFeature::channels(&features(with_color)),
        outputs,
        width: 24,
        depth: 6,
        neighbors: 12,
        cell_m: 0.6,
        low_m: [-RADIUS_M; 3],
        high_m: [RADIUS_M; 3],
        convolution: PlaneConvolution::DepthWise,
    })
}
