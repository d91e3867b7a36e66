//! All scores of a run as Markdown and JSON.

use super::deviations::{Comparison, Quantity, SubmapErrors};
use super::errors::{AbsoluteErrors, PoseScores};
use super::point_scores::{PointScores, REASONS};
use crate::evaluate::instances;
use messages::{ClassId, GROUND_CLASSES};
use scores::{Confusion, InstanceScores, ScoreTable, Statistics};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// The scores of a run.
pub struct RunReport {
    run: String,
    truth: String,
    points: Option<PointScores>,
    confusion: Option<Confusion>,
    instances: Option<Vec<InstanceScores>>,
    poses: Option<PoseScores>,
}

impl RunReport {
    /// Report of the scores. `points` is `None` if the drive has no labels.
    pub fn new(
        run: &Path,
        truth: &Path,
        mut points: Option<PointScores>,
        poses: Option<PoseScores>,
        things: &[ClassId],
        min_points: u64,
        ground: bool,
    ) -> Self {
        let scored = |points: &&PointScores| points.n_without[0] < points.n_points;
        let confusion = points.as_ref().filter(scored).map(|points| {
            let confusion = points.confusion.clone();
            if ground { confusion.merged(ground_or_other) } else { confusion }
        });
        let void = ClassId::Unlabeled as u8;
        let with_instances = points.as_mut().filter(|points| points.n_without[1] < points.n_points);
        let instances = with_instances
            .map(|points| things.iter().map(|class| points.overlaps.score(*class as u8, void, min_points)).collect());
        let run = run.display().to_string();
        let truth = truth.display().to_string();
        Self { run, truth, points, confusion, instances, poses }
    }

    /// Share of the points with a true label, without points of unlabeled sweeps; `None` if the drive has no labels.
    pub fn share_joined(&self) -> Option<f64> {
        self.points.as_ref().map(PointScores::share_joined)
    }

    /// Tables.
    pub fn markdown(&self) -> String {
        let mut text = format!("- run: {}\n- truth: {}\n", self.run, self.truth);
        match &self.points {
            None => text.push_str("- points: the drive has no true labels\n"),
            Some(points) => self.write_points(points, &mut text),
        }
        match &self.poses {
            None => text.push_str("\n## Trajectory\n\nNo pose of the run has a true pose.\n"),
            Some(poses) => write_poses(poses, &mut text),
        }
        text
    }

    fn write_points(&self, points: &PointScores, text: &mut String) {
        // Writing to a string cannot fail.
        let share = 100.0 * points.share_joined();
        let _ = writeln!(text, "- points: {}, with a true label: {} ({share:.2} %)", points.n_points, points.n_joined);
        let [n_unlabeled, n_sweeps] = points.unlabeled_sweeps();
        if n_unlabeled > 0 {
            let _ = writeln!(text, "- unlabeled sweeps: {n_unlabeled} of {n_sweeps}");
            let _ = writeln!(text, "- points of unlabeled sweeps, not scored: {}", points.n_in_unlabeled);
        }
        for (reason, n) in REASONS.iter().zip(points.n_apart).filter(|(_, n)| *n > 0) {
            let _ = writeln!(text, "- points without a true label: {n}: {reason}");
        }
        if points.n_unlabeled > 0 {
            let _ = writeln!(text, "- points that the truth leaves unlabeled, not scored: {}", points.n_unlabeled);
        }
        for (name, n) in ["class", "instance", "color"].iter().zip(points.n_without) {
            if n > 0 && n < points.n_points {
                let _ = writeln!(text, "- points of clouds without column {name}: {n}");
            }
        }
        text.push_str("\n## Classes\n\n");
        match &self.confusion {
            None => text.push_str("The clouds have no classes.\n"),
            Some(confusion) => {
                text.push_str(&score_table("all clouds", confusion).markdown());
                text.push_str(&confusion_table(confusion));
            }
        }
        text.push_str("\n## Instances\n\n");
        match &self.instances {
            None => text.push_str("The clouds have no instances.\n"),
            Some(scores) => text.push_str(&instances::table(scores)),
        }
        text.push_str("\n## Color\n\n");
        if points.n_without[2] == points.n_points {
            text.push_str("The clouds have no colors.\n");
            return;
        }
        let n_colored: u64 = points.colored_by.values().sum();
        let share = 100.0 * n_colored as f64 / points.n_points.max(1) as f64;
        let cameras = points.colored_by.iter().map(|(camera, n)| format!("camera {camera}: {n}"));
        let cameras: Vec<String> = cameras.collect();
        let _ = writeln!(text, "Colored: {n_colored} points ({share:.2} %); {}.", cameras.join(", "));
        text.push_str("The truth of a drive has no true colors, so colors are not scored.\n");
    }

    /// All numbers, unrounded.
    pub fn json(&self) -> Value {
        json!({
            "run": self.run,
            "truth": self.truth,
            "points": self.points.as_ref().map(points_json),
            "classes": self.confusion.as_ref().map(|confusion| score_table("all clouds", confusion).json()[0].clone()),
            "instances": self.instances.as_deref().map(instances::facts),
            "color": self.points.as_ref().map(color_json),
            "trajectory": self.poses.as_ref().map(|poses| poses.aligned.json()),
            "absolute": self.poses.as_ref().and_then(|poses| poses.absolute.as_ref()).map(absolute_json),
            "deviations": self.poses.as_ref().and_then(|poses| poses.submaps.as_ref()).map(deviations_json),
        })
    }
}

fn ground_or_other(class: usize) -> usize {
    let is_ground = GROUND_CLASSES.iter().any(|ground| *ground as usize == class);
    (if is_ground { ClassId::Ground } else { ClassId::Other }) as usize
}

fn score_table(name: &str, confusion: &Confusion) -> ScoreTable {
    let names = ClassId::ALL.iter().map(|class| class.name().to_owned()).collect();
    ScoreTable { names, clouds: vec![(name.to_owned(), confusion.clone())] }
}

/// Points by true class (rows) and predicted class (columns), without empty rows and columns.
fn confusion_table(confusion: &Confusion) -> String {
    let all = || 0..ClassId::ALL.len();
    let rows: Vec<usize> = all().filter(|class| confusion.class(*class).n_truth > 0).collect();
    let columns: Vec<usize> = all().filter(|class| confusion.class(*class).n_predicted > 0).collect();
    let name = |class: &usize| ClassId::ALL[*class].name();
    let mut text = format!(
        "| truth \\ run | {} |\n|---{}|\n",
        columns.iter().map(name).collect::<Vec<_>>().join(" | "),
        "|---".repeat(columns.len())
    );
    for row in &rows {
        let counts: Vec<String> = columns.iter().map(|column| confusion.count(*row, *column).to_string()).collect();
        let _ = writeln!(text, "| {} | {} |", name(row), counts.join(" | "));
    }
    text
}

fn write_poses(poses: &PoseScores, text: &mut String) {
    let _ = write!(text, "\n## Trajectory\n\n{}", poses.aligned.markdown());
    text.push_str("\n## Errors in the world\n\n");
    match (&poses.absolute, &poses.without_absolute) {
        (Some(absolute), _) => {
            text.push_str(
                "| error | unit | n | RMSE | mean | median | p95 | max |\n|---|---|---|---|---|---|---|---|\n",
            );
            for AbsoluteRow { name, unit, found } in absolute.rows() {
                let Some(s) = found else { continue };
                let [rmse, mean, median, p95, max] =
                    [s.rmse, s.mean, s.median, s.p95, s.max].map(|value| format!("{value:.4}"));
                let _ = writeln!(text, "| {name} | {unit} | {} | {rmse} | {mean} | {median} | {p95} | {max} |", s.n);
            }
        }
        (None, reason) => {
            let _ = writeln!(text, "None: {}.", reason.as_deref().unwrap_or("unknown reason"));
        }
    }
    text.push_str("\n## Stated deviations of the submaps\n\n");
    match &poses.submaps {
        None => text.push_str("The run states none.\n"),
        Some(submaps) => write_deviations(submaps, text),
    }
}

fn write_deviations(submaps: &SubmapErrors, text: &mut String) {
    let against = if submaps.is_in_world { "in the world" } else { "against the first submap" };
    let _ = writeln!(
        text,
        "Errors {against} of {} submaps; {} have no true pose.\n",
        submaps.n_submaps, submaps.n_without_truth
    );
    text.push_str("| quantity | unit | n | real RMS | real max | stated RMS | ratio RMS | ratio max | beyond 3 |\n");
    text.push_str("|---|---|---|---|---|---|---|---|---|\n");
    for Quantity { name, unit, comparison: found } in &submaps.quantities {
        let Comparison { n, real_rms, real_max, stated_rms, ratio_rms, ratio_max, n_beyond } = found;
        let _ = writeln!(
            text,
            "| {name} | {unit} | {n} | {real_rms:.4} | {real_max:.4} | {stated_rms:.4} | {ratio_rms:.2} | {ratio_max:.2} | \
             {n_beyond} |"
        );
    }
    let verdict = if submaps.is_honest() { "consistent: no error" } else { "overconfident: an error" };
    let _ = writeln!(text, "\nThe run is {verdict} lies beyond three of its stated deviations.");
}

/// A row of the table of absolute errors.
struct AbsoluteRow {
    name: &'static str,
    unit: &'static str,
    found: Option<Statistics>,
}

impl AbsoluteErrors {
    fn rows(&self) -> [AbsoluteRow; 3] {
        [
            AbsoluteRow { name: "horizontal position", unit: "m", found: self.horizontal },
            AbsoluteRow { name: "height", unit: "m", found: self.height },
            AbsoluteRow { name: "heading", unit: "deg", found: self.heading },
        ]
    }
}

fn points_json(points: &PointScores) -> Value {
    let [outside, no_return, other] = points.n_apart;
    let [no_class, no_instance, no_color] = points.n_without;
    let [n_unlabeled, n_sweeps] = points.unlabeled_sweeps();
    json!({
        "n": points.n_points, "joined": points.n_joined, "share_joined": points.share_joined(),
        "outside_the_sweeps": outside, "without_return": no_return, "other_return": other,
        "unlabeled_in_truth": points.n_unlabeled,
        "in_unlabeled_sweeps": points.n_in_unlabeled, "unlabeled_sweeps": n_unlabeled, "sweeps": n_sweeps,
        "without_class": no_class, "without_instance": no_instance, "without_color": no_color,
    })
}

/// The truth of a drive has no colors of points.
fn color_json(points: &PointScores) -> Value {
    let n_colored: u64 = points.colored_by.values().sum();
    let by_camera: serde_json::Map<String, Value> =
        points.colored_by.iter().map(|(camera, n)| (camera.to_string(), Value::from(*n))).collect();
    json!({
        "colored": n_colored, "share_colored": n_colored as f64 / points.n_points.max(1) as f64, "by_camera": by_camera,
        "true_colors": null,
    })
}

fn absolute_json(absolute: &AbsoluteErrors) -> Value {
    let row = |AbsoluteRow { name, unit, found }: AbsoluteRow| {
        let found = found
            .map(|s| json!({"n": s.n, "rmse": s.rmse, "mean": s.mean, "median": s.median, "p95": s.p95, "max": s.max}));
        json!({"error": name, "unit": unit, "of": found})
    };
    Value::Array(absolute.rows().into_iter().map(row).collect())
}

fn deviations_json(submaps: &SubmapErrors) -> Value {
    let row = |Quantity { name, unit, comparison: found }: &Quantity| {
        json!({
            "quantity": name, "unit": unit, "n": found.n, "real_rms": found.real_rms, "real_max": found.real_max,
            "stated_rms": found.stated_rms, "ratio_rms": found.ratio_rms, "ratio_max": found.ratio_max,
            "beyond_3": found.n_beyond,
        })
    };
    json!({
        "in_world": submaps.is_in_world, "submaps": submaps.n_submaps, "without_truth": submaps.n_without_truth,
        "honest": submaps.is_honest(), "quantities": submaps.quantities.iter().map(row).collect::<Vec<_>>(),
    })
}
