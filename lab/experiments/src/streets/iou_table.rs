//! Tables of scores by class.

use super::classes::ALL;
use crate::experiment::Results;
use crate::outcome::Outcome;
use crate::statistics::{mean_and_deviation, min_and_max};
use messages::ClassId;
use scores::{ClassScores, Confusion};
use std::fmt::Write;

/// A kind of training: its name and its finished results. A network that learns n classes learns the first n of [`ALL`].
pub struct Column<'a> {
    pub name: String,
    pub outcomes: Vec<&'a Outcome>,
}

/// The kinds of training in a table, in order: its columns and rows are merged into names.
pub fn columns<'a>(results: &'a Results, name: impl Fn(&crate::recipe::Recipe) -> Option<String>) -> Vec<Column<'a>> {
    let mut columns: Vec<Column<'a>> = Vec::new();
    for (recipe, outcome) in results {
        let Some(name) = name(recipe) else { continue };
        match columns.iter_mut().find(|column| column.name == name) {
            Some(column) => column.outcomes.push(outcome),
            None => columns.push(Column { name, outcomes: vec![outcome] }),
        }
    }
    columns
}

impl Column<'_> {
    /// Mean over the seeds, minimum and maximum; `-` if a value does not exist.
    fn cell(&self, value: impl Fn(&Confusion) -> Option<f64>) -> String {
        let values: Option<Vec<f64>> = self.outcomes.iter().map(|outcome| value(&outcome.confusion())).collect();
        values.map_or_else(
            || "-".to_owned(),
            |values| {
                let percents: Vec<f64> = values.iter().map(|value| 100.0 * value).collect();
                let [least, largest] = min_and_max(&percents);
                format!("{:.1} ({least:.1} to {largest:.1})", mean_and_deviation(&percents).0)
            },
        )
    }
    fn seeds(&self) -> String {
        let converged = self.outcomes.iter().filter(|outcome| outcome.converged).count();
        format!("{converged}/{}", self.outcomes.len())
    }
    fn epochs(&self) -> String {
        let best: Vec<f64> = self.outcomes.iter().map(|outcome| outcome.best_epoch as f64).collect();
        format!("{:.1}", mean_and_deviation(&best).0)
    }
}

/// Scores of a class that the network learns and that occurs.
fn class_scores(confusion: &Confusion, n_classes: usize, class: ClassId) -> Option<ClassScores> {
    let index = ALL.iter().position(|of| *of == class).filter(|index| *index < n_classes)?;
    Some(confusion.class(index)).filter(|scores| scores.n_truth > 0)
}

fn n_classes(column: &Column<'_>) -> usize {
    column.outcomes.first().and_then(|outcome| outcome.scenes.first()).map_or(0, |scene| scene.confusion.len())
}

/// The IoU of each class in percent, as mean and range over the seeds. The last rows are the means over the classes of each column and
/// over the `n_shared` first classes, the overall accuracy, the share of finished seeds that converged, and the best epoch.
pub fn iou_table(columns: &[Column<'_>], n_shared: usize) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let mut text = format!("| class | {} |\n|---|{}\n", names.join(" | "), "---|".repeat(names.len()));
    let mut row = |name: &str, cell: &dyn Fn(&Column<'_>) -> String| {
        let cells: Vec<String> = columns.iter().map(cell).collect();
        let _ = writeln!(text, "| {name} | {} |", cells.join(" | "));
    };
    for class in ALL {
        row(class.name(), &|column| column.cell(|confusion| class_scores(confusion, n_classes(column), class)?.iou));
    }
    row("mean of own classes", &|column| column.cell(Confusion::mean_iou));
    if n_shared < ALL.len() {
        row(&format!("mean of {n_shared}"), &|column| {
            column.cell(|confusion| {
                let of = |class: &ClassId| class_scores(confusion, n_classes(column), *class)?.iou;
                let ious: Vec<f64> = ALL[..n_shared].iter().filter_map(of).collect();
                (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64)
            })
        });
    }
    row("OA", &|column| column.cell(Confusion::overall_accuracy));
    row("converged / seeds", &|column| column.seeds());
    row("best epoch", &|column| column.epochs());
    text
}

type Score = fn(&ClassScores) -> Option<f64>;

/// Precision, recall, IoU.
const SCORES: [Score; 3] = [|scores| scores.precision, |scores| scores.recall, |scores| scores.iou];

/// Precision, recall and IoU of each class in percent, mean over the seeds, for each column: the form of tables 6.4, 6.5 and 6.7.
pub fn precision_table(columns: &[Column<'_>]) -> String {
    let mut text = String::from("| class |");
    for column in columns {
        let _ = write!(text, " {} P | R | IoU |", column.name);
    }
    let _ = writeln!(text, "\n|---|{}", "---|".repeat(3 * columns.len()));
    // Scores of a class without predictions are 0, as in the thesis.
    let values = |column: &Column<'_>, score: Score, class: ClassId| -> Vec<f64> {
        let of = |outcome: &&Outcome| {
            class_scores(&outcome.confusion(), n_classes(column), class)
                .map(|scores| 100.0 * score(&scores).unwrap_or(0.0))
        };
        column.outcomes.iter().filter_map(of).collect()
    };
    for class in ALL {
        let _ = write!(text, "| {} |", class.name());
        for (column, score) in columns.iter().flat_map(|column| SCORES.map(|score| (column, score))) {
            let values = values(column, score, class);
            let cell = if values.is_empty() { "-".into() } else { format!("{:.1}", mean_and_deviation(&values).0) };
            let _ = write!(text, " {cell} |");
        }
        text.push('\n');
    }
    text.push_str("| mean |");
    for (column, score) in columns.iter().flat_map(|column| SCORES.map(|score| (column, score))) {
        let means = ALL.iter().map(|class| values(column, score, *class)).filter(|values| !values.is_empty());
        let means: Vec<f64> = means.map(|values| mean_and_deviation(&values).0).collect();
        let _ = write!(text, " {:.1} |", mean_and_deviation(&means).0);
    }
    text.push_str("\n| OA |");
    for column in columns {
        let _ = write!(text, " {} | | |", column.cell(Confusion::overall_accuracy));
    }
    text.push_str("\n| converged / seeds |");
    for column in columns {
        let _ = write!(text, " {} | | |", column.seeds());
    }
    text.push('\n');
    text
}
