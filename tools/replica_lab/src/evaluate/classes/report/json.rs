//! Further keys of the JSON of a source.

use crate::evaluate::classes::coverage::{Coverage, Kept, THRESHOLDS};
use crate::evaluate::classes::source::{Origin, Source};
use crate::evaluate::classes::tally::Tally;
use crate::evaluate::classes::{ranges, seven};
use scores::{Confusion, ScoreTable};
use serde_json::{Value, json};

/// Adds the measures other than the scores of the classes.
pub fn extend(cloud: &mut Value, tally: &Tally) {
    let has_scores = !tally.coverage.is_empty();
    let has_ranges = tally.ranges.iter().any(|range| range.classes.n() > 0);
    cloud["n_unknown"] = tally.n_unknown.into();
    cloud["seven_classes"] = if tally.seven.n() > 0 { seven_classes(&tally.seven) } else { Value::Null };
    cloud["calibration_error"] = tally.calibration_error().into();
    cloud["coverage"] = if has_scores { coverage(&tally.coverage) } else { Value::Null };
    cloud["ranges"] = if has_ranges { ranges_json(tally) } else { Value::Null };
}

/// Adds the facts of a single source. `note` states whether its figures can be compared with published ones.
pub fn extend_source(cloud: &mut Value, source: &Source, note: Option<&str>) {
    cloud["n_sweeps"] = (source.n_sweeps > 0).then_some(source.n_sweeps).into();
    if let Origin::Simulated(sensor) = &source.origin {
        cloud["sensor"] = sensor.as_str().into();
    }
    if let Origin::Street(name) = &source.origin {
        cloud["street"] = name.as_str().into();
    }
    if let Some(note) = note {
        cloud["note"] = note.into();
    }
    let of_use = |(word, tally): &(&'static str, Tally)| {
        json!({
            "intensity": word,
            "mean_iou": tally.classes.mean_iou(),
            "mean_iou_of_seven_classes": tally.seven.mean_iou(),
            "overall_accuracy": tally.classes.overall_accuracy(),
            "calibration_error": tally.calibration_error(),
        })
    };
    if !source.other_uses.is_empty() {
        cloud["other_intensities"] = source.other_uses.iter().map(of_use).collect();
    }
}

fn seven_classes(confusion: &Confusion) -> Value {
    let names = seven::NAMES.map(str::to_owned).to_vec();
    let table = ScoreTable { names, clouds: vec![(String::new(), confusion.clone())] };
    let mut scores = table.json()[0].take();
    if let Some(keys) = scores.as_object_mut() {
        keys.remove("cloud");
    }
    scores
}

fn coverage(coverage: &Coverage) -> Value {
    let at = |threshold: f64| {
        let Kept { share, accuracy } = coverage.kept(threshold);
        json!({ "min_score": threshold, "kept": share, "accuracy": accuracy })
    };
    json!({ "area": coverage.area(), "thresholds": THRESHOLDS.map(at) })
}

fn ranges_json(tally: &Tally) -> Value {
    let range = |(name, range): (&&str, &ranges::OfRange)| {
        json!({
            "range": name,
            "n_points": range.classes.n(),
            "mean_iou": range.classes.mean_iou(),
            "mean_iou_of_seven_classes": range.seven.mean_iou(),
            "overall_accuracy": range.classes.overall_accuracy(),
        })
    };
    ranges::NAMES.iter().zip(&tally.ranges).map(range).collect()
}
