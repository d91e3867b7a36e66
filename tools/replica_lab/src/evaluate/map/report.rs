//! The scores of clouds as Markdown and JSON.

use scores::Statistics;
use scores::map::{Crispness, Distances, WITHIN_M};
use serde_json::{Value, json};
use std::fmt::Write;

/// The scores of one cloud.
pub struct MapReport {
    /// Path of the cloud.
    pub name: String,
    /// Number of points.
    pub n_points: usize,
    /// Sharpness, which needs no truth.
    pub crispness: Crispness,
    /// Distances to the truth, and from the truth.
    pub distances: Option<[Distances; 2]>,
}

/// Markdown tables with one row per cloud.
pub fn markdown(reports: &[MapReport]) -> String {
    let number =
        |value: Option<f64>, decimals: usize| value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"));
    let mut text =
        "| cloud | points | facades | thickness, cm: median | mean | p95 | too thick | mean map entropy | samples |\n\
                    |---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for MapReport { name, n_points, crispness, .. } in reports {
        let cm = |value: fn(Statistics) -> f64| number(crispness.thickness_m.map(|found| 100.0 * value(found)), 2);
        let median = cm(|s| s.median);
        let mean = cm(|s| s.mean);
        let p95 = cm(|s| s.p95);
        let n_facades = crispness.thickness_m.map_or(0, |found| found.n);
        let entropy = number(crispness.mean_entropy, 4);
        let n = crispness.n_entropies;
        let too_thick = crispness.n_too_thick;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {name} | {n_points} | {n_facades} | {median} | {mean} | {p95} | {too_thick} | {entropy} | {n} |"
        );
    }
    if reports.iter().any(|report| report.distances.is_some()) {
        text.push_str(
            "\n| cloud | direction | median, cm | RMSE, cm | p95, cm | within 5 cm, % | 10 cm | 20 cm | far, % |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
    }
    for MapReport { name, distances, .. } in reports {
        let directions = ["cloud to truth", "truth to cloud"];
        for (direction, found) in directions.iter().zip(distances.iter().flatten()) {
            let cm = |value: fn(Statistics) -> f64| number(found.near_m.map(|near| 100.0 * value(near)), 2);
            let within = found.within.map(|share| format!("{:.2}", 100.0 * share)).join(" | ");
            let median = cm(|s| s.median);
            let rmse = cm(|s| s.rmse);
            let p95 = cm(|s| s.p95);
            let far = 100.0 * found.far;
            let _ = writeln!(text, "| {name} | {direction} | {median} | {rmse} | {p95} | {within} | {far:.2} |");
        }
    }
    text
}

/// All numbers, not rounded, in m.
pub fn json(reports: &[MapReport]) -> Value {
    let statistics = |found: Statistics| {
        json!({
            "n": found.n, "rmse": found.rmse, "mean": found.mean, "median": found.median, "p95": found.p95,
            "deviation": found.deviation, "min": found.min, "max": found.max,
        })
    };
    let distances = |found: &Distances| {
        let within: Vec<Value> =
            WITHIN_M.iter().zip(found.within).map(|(m, share)| json!({"m": m, "share": share})).collect();
        json!({"near_m": found.near_m.map(statistics), "within": within, "far": found.far})
    };
    let report = |report: &MapReport| {
        json!({
            "cloud": report.name,
            "points": report.n_points,
            "facade_thickness_m": report.crispness.thickness_m.map(statistics),
            "too_thick": report.crispness.n_too_thick,
            "mean_map_entropy": report.crispness.mean_entropy,
            "entropies": report.crispness.n_entropies,
            "cloud_to_truth": report.distances.as_ref().map(|[there, _]| distances(there)),
            "truth_to_cloud": report.distances.as_ref().map(|[_, back]| distances(back)),
        })
    };
    Value::from(reports.iter().map(report).collect::<Vec<_>>())
}
