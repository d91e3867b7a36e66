//! The scores of a trajectory as Markdown, JSON and CSV.

use scores::Statistics;
use scores::trajectory::{
    Association, PosePair, RelativeError, Segment, distances_along, position_errors, rotation_errors,
};
use serde_json::{Value, json};
use std::fmt::Write;

/// The scores of a trajectory.
pub struct Report {
    /// What was compared, and with which settings.
    pub heading: Vec<(&'static str, String)>,
    /// Poses of the estimate without a pair, by reason.
    pub unpaired: [(&'static str, usize); 3],
    /// Pairs of poses after alignment.
    pub pairs: Vec<PosePair>,
    /// Relative errors, with the names of the intervals.
    pub relative: Vec<(String, Vec<RelativeError>)>,
    /// Segments as defined by KITTI.
    pub segments: Vec<Segment>,
}

/// Poses of the estimate without a pair, by reason.
pub fn unpaired(association: &Association) -> [(&'static str, usize); 3] {
    [
        ("outside the time of the truth", association.n_outside),
        ("in a gap of the truth", association.n_in_gaps),
        ("too close to the previous pose", association.n_close),
    ]
}

/// A row of the table of errors.
struct ErrorRow {
    name: String,
    unit: &'static str,
    found: Option<Statistics>,
}

/// A row of the table of segments.
#[derive(Debug)]
pub struct SegmentRow {
    /// Length; `None`: all.
    pub length_m: Option<f64>,
    /// Number of segments.
    pub n: usize,
    pub translation_percent: f64,
    pub rotation_deg_per_100_m: f64,
}

impl Report {
    /// Absolute and relative errors.
    fn rows(&self) -> Vec<ErrorRow> {
        let degrees = 180.0 / std::f64::consts::PI;
        let in_degrees = |values: Vec<f64>| Statistics::from_values(values).map(|found| found.times(degrees));
        let row = |name: &str, unit, found| ErrorRow { name: name.to_owned(), unit, found };
        let mut rows = vec![
            row("position (ATE)", "m", Statistics::from_values(position_errors(&self.pairs))),
            row("rotation", "deg", in_degrees(rotation_errors(&self.pairs))),
        ];
        for (name, errors) in &self.relative {
            let translation = Statistics::from_values(errors.iter().map(|error| error.translation_m));
            let rotation = in_degrees(errors.iter().map(|error| error.rotation_rad).collect());
            rows.push(row(&format!("{name}, translation"), "m", translation));
            rows.push(row(&format!("{name}, rotation"), "deg", rotation));
        }
        rows
    }

    /// Mean errors of the segments by length.
    pub fn segment_rows(&self) -> Vec<SegmentRow> {
        let row = |length_m: Option<f64>| {
            let of_length = || self.segments.iter().filter(|segment| length_m.is_none_or(|l| segment.length_m == l));
            let n = of_length().count();
            let mean = |value: fn(&Segment) -> f64| of_length().map(value).sum::<f64>() / n as f64;
            let rotation = mean(|segment| segment.rotation_rad_per_m);
            SegmentRow {
                length_m,
                n,
                translation_percent: 100.0 * mean(|segment| segment.translation),
                rotation_deg_per_100_m: 100.0 * rotation.to_degrees(),
            }
        };
        let mut lengths: Vec<f64> = self.segments.iter().map(|segment| segment.length_m).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.dedup();
        let lengths = lengths.into_iter().map(Some).chain((!self.segments.is_empty()).then_some(None));
        lengths.map(row).collect()
    }

    /// Markdown tables.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        for (name, value) in &self.heading {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "- {name}: {value}");
        }
        let unpaired = self.unpaired.iter().filter(|(_, n)| *n > 0).map(|(why, n)| format!("; {n} {why}"));
        let _ = writeln!(text, "- poses: {} paired{}", self.pairs.len(), unpaired.collect::<String>());
        text.push_str("\n| error | unit | n | RMSE | mean | median | p95 | max |\n|---|---|---|---|---|---|---|---|\n");
        for ErrorRow { name, unit, found } in self.rows() {
            let numbers = match found {
                None => "0 | - | - | - | - | -".to_owned(),
                Some(s) => {
                    let [rmse, mean, median, p95, max] =
                        [s.rmse, s.mean, s.median, s.p95, s.max].map(|value| format!("{value:.4}"));
                    format!("{} | {rmse} | {mean} | {median} | {p95} | {max}", s.n)
                }
            };
            let _ = writeln!(text, "| {name} | {unit} | {numbers} |");
        }
        if self.segments.is_empty() {
            text.push_str("\nThe trajectory is too short for segments of these lengths.\n");
            return text;
        }
        text.push_str("\n| segments, m | n | translation, % | rotation, deg per 100 m |\n|---|---|---|---|\n");
        for row in self.segment_rows() {
            let SegmentRow { length_m, n, translation_percent: translation, rotation_deg_per_100_m: rotation } = row;
            let length = length_m.map_or("all".to_owned(), |length| length.to_string());
            let _ = writeln!(text, "| {length} | {n} | {translation:.4} | {rotation:.4} |");
        }
        text
    }

    /// All numbers, unrounded.
    pub fn json(&self) -> Value {
        let statistics = |found: Statistics| {
            json!({
                "n": found.n, "rmse": found.rmse, "mean": found.mean, "median": found.median, "p95": found.p95,
                "deviation": found.deviation, "min": found.min, "max": found.max,
            })
        };
        let error = |ErrorRow { name, unit, found }: ErrorRow| json!({"error": name, "unit": unit, "of": found.map(statistics)});
        let segment = |row: SegmentRow| {
            json!({
                "length_m": row.length_m, "n": row.n, "translation_percent": row.translation_percent,
                "rotation_deg_per_100_m": row.rotation_deg_per_100_m,
            })
        };
        json!({
            "about": self.heading.iter().map(|(name, value)| ((*name).to_owned(), Value::from(value.as_str())))
                .collect::<serde_json::Map<_, _>>(),
            "pairs": self.pairs.len(),
            "left_out": self.unpaired.iter().map(|(why, n)| ((*why).to_owned(), Value::from(*n)))
                .collect::<serde_json::Map<_, _>>(),
            "errors": self.rows().into_iter().map(error).collect::<Vec<_>>(),
            "segments": self.segment_rows().into_iter().map(segment).collect::<Vec<_>>(),
        })
    }

    /// CSV with one line per pair.
    pub fn poses_csv(&self) -> String {
        let mut text =
            "stamp,way_m,east_error_m,north_error_m,up_error_m,position_error_m,rotation_error_deg\n".to_owned();
        let errors = position_errors(&self.pairs).into_iter().zip(rotation_errors(&self.pairs));
        for ((pair, distance_m), (position, rotation)) in
            self.pairs.iter().zip(distances_along(&self.pairs)).zip(errors)
        {
            let off = pair.estimate.translation.vector - pair.truth.translation.vector;
            let stamp = pair.stamp.0;
            let _ = writeln!(
                text,
                "{stamp},{distance_m},{},{},{},{position},{}",
                off.x,
                off.y,
                off.z,
                rotation.to_degrees()
            );
        }
        text
    }

    /// CSV with one line per segment.
    pub fn segments_csv(&self) -> String {
        let mut text = "first_stamp,last_stamp,length_m,translation_percent,rotation_deg_per_100_m\n".to_owned();
        for segment in &self.segments {
            let [first, last] = [segment.first, segment.last].map(|i| self.pairs[i].stamp.0);
            let rotation = 100.0 * segment.rotation_rad_per_m.to_degrees();
            let _ = writeln!(text, "{first},{last},{},{},{rotation}", segment.length_m, 100.0 * segment.translation);
        }
        text
    }
}
