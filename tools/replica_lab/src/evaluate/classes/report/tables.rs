//! Markdown tables.

use crate::evaluate::classes::coverage::{Coverage, Kept, THRESHOLDS};
use crate::evaluate::classes::source::{Group, Source};
use crate::evaluate::classes::tally::Tally;
use crate::evaluate::classes::{ranges, seven};
use messages::ClassId;
use scores::Confusion;
use std::fmt::Write;

/// A line for each source, each other use of its intensities, each group, and all.
pub fn data(sources: &[Source], groups: &[Group], intensity: &str) -> String {
    let mut text = String::from(
        "| data | sweeps | points | mIoU | mIoU, seven classes | OA | calibration error |\n|---|---|---|---|---|---|---|\n",
    );
    for source in sources {
        let has_others = !source.other_uses.is_empty();
        let of_use = |word: &str| format!("{}, intensity {word}", source.name);
        let name = if has_others { of_use(intensity) } else { source.name.clone() };
        text.push_str(&line(&name, source.n_sweeps, &source.tally));
        for (word, tally) in &source.other_uses {
            text.push_str(&line(&of_use(word), source.n_sweeps, tally));
        }
    }
    if sources.len() > 1 {
        for group in groups {
            text.push_str(&line(&format!("**{}**", group.name), group.n_sweeps, &group.tally));
        }
    }
    if groups.len() > 1 {
        let n_sweeps = groups.iter().map(|group| group.n_sweeps).sum();
        text.push_str(&line("**all**", n_sweeps, &Tally::sum(groups.iter().map(|group| &group.tally))));
    }
    text
}

fn line(name: &str, n_sweeps: usize, tally: &Tally) -> String {
    let Tally { classes, seven, .. } = tally;
    let [miou, of_seven] = [classes, seven].map(|confusion| percent(confusion.mean_iou()));
    let accuracy = percent(classes.overall_accuracy());
    let error = percent(tally.calibration_error());
    let sweeps = if n_sweeps > 0 { n_sweeps.to_string() } else { "-".to_owned() };
    format!("| {name} | {sweeps} | {} | {miou} | {of_seven} | {accuracy} | {error} |\n", classes.n())
}

/// Number of points without class, and accuracy of the others.
pub fn unknown(tally: &Tally) -> String {
    let Tally { classes, n_unknown, .. } = tally;
    let n = classes.n();
    let n_correct = (0..ClassId::ALL.len()).map(|class| classes.count(class, class)).sum::<u64>();
    let share = percent(Some(*n_unknown as f64 / n as f64));
    let n_known = n - n_unknown;
    let accuracy = percent((n_known > 0).then(|| n_correct as f64 / n_known as f64));
    format!("Points without a predicted class: {n_unknown} ({share}). Correct points of the others: {accuracy}.")
}

/// Real sweeps without intensities, which are scored only once.
pub fn without_intensities(sources: &[Source]) -> Option<String> {
    let real = sources.iter().filter(|source| source.origin.is_real() && !source.has_intensities);
    let names: Vec<&str> = real.map(|source| source.name.as_str()).collect();
    (!names.is_empty()).then(|| format!("Without intensities: sweeps of {}.", names.join(", ")))
}

/// Classes that are not part of the mean of the seven.
pub fn absent_of_seven(confusion: &Confusion) -> String {
    let absent = (0..seven::N).filter(|class| confusion.class(*class).n_truth == 0);
    let absent: Vec<&str> = absent.map(|class| seven::NAMES[class]).collect();
    if absent.is_empty() {
        return String::new();
    }
    let n = seven::N - absent.len();
    format!("Mean over {n} of the seven classes. Without labeled points: {}.\n\n", absent.join(", "))
}

/// Scores by distance from the LiDAR.
pub fn ranges(tally: &Tally) -> String {
    let mut text = String::from("| range | points | mIoU | mIoU, seven classes | OA |\n|---|---|---|---|---|\n");
    for (name, range) in ranges::NAMES.iter().zip(&tally.ranges) {
        let [miou, of_seven] = [&range.classes, &range.seven].map(|confusion| percent(confusion.mean_iou()));
        let accuracy = percent(range.classes.overall_accuracy());
        let _ = writeln!(text, "| {name} | {} | {miou} | {of_seven} | {accuracy} |", range.classes.n());
    }
    text
}

/// Points with a score of at least some thresholds.
pub fn coverage(coverage: &Coverage) -> String {
    let area = coverage.area().map_or_else(|| "-".to_owned(), |area| format!("{area:.3}"));
    let mut text = String::from("| score at least | points kept | correct |\n|---|---|---|\n");
    for threshold in THRESHOLDS {
        let Kept { share, accuracy } = coverage.kept(threshold);
        let _ = writeln!(text, "| {threshold:.2} | {} | {} |", percent(Some(share)), percent(accuracy));
    }
    let _ = writeln!(text, "\nArea below the curve: {area} (1: all points are correct).");
    text
}

/// Predictions of each true class, percent of its points.
pub fn confusion(confusion: &Confusion) -> String {
    let all = || 0..ClassId::ALL.len();
    let rows: Vec<usize> = all().filter(|class| confusion.class(*class).n_truth > 0).collect();
    let columns: Vec<usize> = all().filter(|class| confusion.class(*class).n_predicted > 0).collect();
    let name = |class: &usize| ClassId::ALL[*class].name();
    let mut text = format!(
        "Percent of the points of each true class; a dot is 0.\n\n| truth \\ predicted | points | {} |\n|---|---{}|\n",
        columns.iter().map(name).collect::<Vec<_>>().join(" | "),
        "|---".repeat(columns.len())
    );
    for row in &rows {
        let n = confusion.class(*row).n_truth;
        let share = |column: &usize| match confusion.count(*row, *column) {
            0 => ".".to_owned(),
            count => format!("{:.1}", 100.0 * count as f64 / n as f64),
        };
        let shares: Vec<String> = columns.iter().map(share).collect();
        let _ = writeln!(text, "| {} | {n} | {} |", name(row), shares.join(" | "));
    }
    text
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}
