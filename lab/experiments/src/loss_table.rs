//! Tables of losses: mIoU by loss and kind of training.

use crate::experiment::Results;
use crate::statistics::{mean_and_deviation, min_and_max};
use std::fmt::Write;
use training::Loss;

/// Prefix of the name of a loss that is the mean over the levels of a class tree.
pub const OVER_THE_TREE: &str = "hierarchical ";

/// A loss by its name in the thesis, with or without [`OVER_THE_TREE`].
pub fn loss(name: &str) -> Loss {
    match name.strip_prefix(OVER_THE_TREE).unwrap_or(name) {
        "CE" => Loss::CrossEntropy,
        "focal" => Loss::Focal { gamma: 2.0 },
        "Dice" => Loss::Dice,
        "CE + Jac. 2" => Loss::CrossEntropyPowerJaccard { power: 2.0 },
        "Jac. 1" => Loss::Jaccard,
        "Jac. 1.25" => Loss::PowerJaccard { power: 1.25 },
        "Jac. 1.5" => Loss::PowerJaccard { power: 1.5 },
        "Jac. 1.75" => Loss::PowerJaccard { power: 1.75 },
        _ => Loss::PowerJaccard { power: 2.0 },
    }
}

/// One row per loss, one column per kind of training: mean and deviation of mIoU over the seeds, the best one in parentheses, and the
/// number of finished seeds that converged.
pub fn table_of_losses(results: &Results) -> String {
    let mut rows: Vec<&str> = Vec::new();
    let mut columns: Vec<&str> = Vec::new();
    for (recipe, _) in results {
        for (names, name) in [(&mut rows, &recipe.row), (&mut columns, &recipe.column)] {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
    }
    let mut text = format!("| loss | {} |\n|---|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
    for row in rows {
        let cells: Vec<String> = columns.iter().map(|column| cell(results, row, column)).collect();
        let _ = writeln!(text, "| {row} | {} |", cells.join(" | "));
    }
    text
}

fn cell(results: &Results, row: &str, column: &str) -> String {
    let of_cell = results.iter().filter(|(recipe, _)| recipe.row == row && recipe.column == column);
    let (ious, converged): (Vec<f64>, Vec<bool>) =
        of_cell.map(|(_, outcome)| (outcome.mean_iou(), outcome.converged)).unzip();
    if ious.is_empty() {
        return "-".to_owned();
    }
    let (mean, deviation) = mean_and_deviation(&ious);
    let [_, best] = min_and_max(&ious);
    let n_converged = converged.iter().filter(|converged| **converged).count();
    format!("{mean:.3}±{deviation:.3} ({best:.3}) {n_converged}/{}", ious.len())
}
