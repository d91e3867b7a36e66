//! Tables 6.6 and 6.7: transfer of a model to another sensor and another kind of town.

use super::classes::ALL;
use super::iou_table::{columns, iou_table, precision_table};
use super::street_data::StreetData;
use super::{Kind, Streets, recipe};
use crate::experiment::{Experiment, Results};
use crate::recipe::Recipe;
use crate::task::Task;

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

/// Numbers of training drives of the target, with four sweeps each.
const TARGETS: [u64; 2] = [2, 20];

const SOURCE: &str = "source";

/// Tables 6.6 and 6.7.
pub struct Transfer(pub Streets);

impl Experiment for Transfer {
    fn name(&self) -> &'static str {
        "transfer"
    }
    fn recipes(&self, n_seeds: u64) -> Vec<Recipe> {
        let loss = "CE + Jac. 2";
        let source = |seed| recipe(&Kind::new(loss, SOURCE, StreetData::UrbanUpright, &ALL), seed);
        let target = |(n_drives, seed, method): (u64, u64, &Method)| {
            let column = format!("{} sweeps", 4 * n_drives);
            let mut recipe = recipe(&Kind::new(loss, &column, StreetData::Rural(n_drives), &ALL), seed);
            method.name.clone_into(&mut recipe.row);
            recipe.start = method.is_transferred.then(|| Box::new(source(seed)));
            recipe.frozen = method.frozen.unwrap_or_default().iter().map(|&prefix| prefix.to_owned()).collect();
            if method.frozen.is_none() {
                recipe.settings.epochs = 0;
            }
            recipe
        };
        let kinds =
            TARGETS.iter().flat_map(|&n| (0..n_seeds).flat_map(move |seed| METHODS.iter().map(move |m| (n, seed, m))));
        (0..n_seeds).map(source).chain(kinds.map(target)).collect()
    }
    fn load(&self, recipe: &Recipe) -> anyhow::Result<Task> {
        let all = [StreetData::UrbanUpright].into_iter().chain(TARGETS.map(StreetData::Rural));
        self.0.load(recipe, all, &ALL)
    }
    fn cpu_seconds(&self, recipe: &Recipe) -> f64 {
        if recipe.settings.epochs == 0 { 1.0 } else { super::CPU_SECONDS }
    }
    fn table(&self, results: &Results) -> String {
        let mut text = String::new();
        for n_drives in TARGETS {
            let name = format!("{} sweeps", 4 * n_drives);
            let of_target = columns(results, |recipe| (recipe.column == name).then(|| recipe.row.clone()));
            text += &[name.as_str(), ":\n\n", &iou_table(&of_target, ALL.len()), "\n"].concat();
        }
        let best = |recipe: &Recipe| {
            let is_shown = recipe.column != SOURCE && matches!(recipe.row.as_str(), "nothing frozen" | "no transfer");
            is_shown.then(|| format!("{}, {}", recipe.row, recipe.column))
        };
        text + "Table 6.7:\n\n" + &precision_table(&columns(results, best))
    }
}
