//! Section 7.3: a curriculum by class complexity, and a class tree grown from confusions.

use super::classes::{ALL, SIMPLE};
use super::iou_table::{columns, iou_table};
use super::street_data::StreetData;
use super::{Kind, Streets, recipe};
use crate::experiment::{Experiment, Results};
use crate::recipe::Recipe;
use crate::task::Task;

/// Loss of the trainings without a tree: Jac. 2 alone learns hardly any class, so its confusions would be meaningless.
const LOSS: &str = "CE + Jac. 2";
const HIERARCHICAL: &str = "hierarchical CE + Jac. 2";
const SIMPLE_FIRST: &str = "simple classes";
/// Appended to the description of the data of the first stage.
const ONLY_SIMPLE: &str = ", labels of simple classes only";

/// Section 7.3.
pub struct Perspectives(pub Streets);

impl Experiment for Perspectives {
    fn name(&self) -> &'static str {
        "perspectives"
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let of_loss = |row: &str, seed| recipe(&Kind::new(row, "urban", StreetData::Urban, &ALL), seed);
        let of_seed = |seed| {
            let plain = of_loss(LOSS, seed);
            let named = |row: &str, of: Recipe| Recipe { row: row.to_owned(), ..of };
            let after = |row: &str, start: &Recipe| Recipe {
                start: Some(Box::new(start.clone())),
                ..named(row, plain.clone())
            };
            let mut simple = named(SIMPLE_FIRST, plain.clone());
            simple.data += ONLY_SIMPLE;
            let grown = Recipe {
                tree_of: Some(Box::new(plain.clone())),
                ..named("tree of confusions", of_loss(HIERARCHICAL, seed))
            };
            let curriculum = after("curriculum", &simple);
            let twice = after("trained twice", &plain);
            [plain, of_loss(HIERARCHICAL, seed), grown, twice, simple, curriculum]
        };
        (0..n_seeds).flat_map(of_seed).collect()
    }
    fn load(&self, recipe: &Recipe) -> anyhow::Result<Task> {
        let task = self.0.load(recipe, [StreetData::Urban], &ALL)?;
        let is_first_stage = recipe.data.ends_with(ONLY_SIMPLE);
        Ok(if is_first_stage { task.with_labels_of(&ALL.map(|class| SIMPLE.contains(&class))) } else { task })
    }
    fn cpu_seconds(&self, _: &Recipe) -> f64 {
        super::CPU_SECONDS
    }
    fn table(&self, results: &Results) -> String {
        let is_shown = |recipe: &Recipe| (recipe.row != SIMPLE_FIRST).then(|| recipe.row.clone());
        iou_table(&columns(results, is_shown), ALL.len())
    }
}
