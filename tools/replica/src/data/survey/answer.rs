//! The answer of `replica survey`, and its doubts.

use adjustment::{ControlPoint, MeanResidual, SeenControl, Submaps, Survey, Weighed, disagreement};
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use surveying::SurveyAccuracy;
use surveying::accuracy::{Accuracy, AxisAccuracy, DriveHeights};
use surveying::check_points::PointUse;

/// What the answer is made from.
pub struct Facts<'a> {
    pub submaps: &'a Submaps,
    pub survey: &'a Survey,
    pub points: &'a [ControlPoint],
    /// Mean residual of each point that a submap shows.
    pub means: &'a [MeanResidual],
    pub accuracy: &'a SurveyAccuracy,
}

/// What was adjusted.
#[derive(Serialize)]
pub struct Answered<'a> {
    out: &'a Path,
    n_submaps: usize,
    drives: Vec<MovedDrive>,
    pairs: Vec<Pair>,
    control: PointResiduals,
    check: PointResiduals,
    /// Height differences of each two drives.
    heights: Vec<DriveHeights>,
    /// Largest standard deviation of a submap, horizontally and up, m.
    largest_sigma_m: [f64; 2],
}

/// A drive, and how far its submaps were moved.
#[derive(Serialize)]
struct MovedDrive {
    name: String,
    n_submaps: usize,
    /// Root mean square, horizontally and up, m.
    moved_m: [f64; 2],
}

/// Two drives that meet.
#[derive(Serialize)]
struct Pair {
    drives: [String; 2],
    n_matches: usize,
    n_refused: usize,
    /// How far matched submaps were apart, root mean square horizontally and up, m.
    before_m: [f64; 2],
    after_m: [f64; 2],
}

/// Residuals of points, with the mean of the submaps that show a point.
#[derive(Serialize)]
struct PointResiduals {
    n_points: usize,
    n_seen: usize,
    /// Control points that contradict the other measurements. They do not count below.
    n_refused: usize,
    /// Root mean square east, north and up, m. `None` if no point is measured along the axis.
    rmse_m: [Option<f64>; 3],
    accuracy: Accuracy,
}

impl<'a> Answered<'a> {
    pub fn new(facts: &Facts<'_>, out: &'a Path) -> Self {
        let Facts { submaps, survey, points, means, accuracy } = facts;
        let drives = submaps.drives.iter().enumerate().map(|(index, drive)| {
            let numbers = (0..submaps.all.len()).filter(|k| submaps.all[*k].drive == index);
            let moved = numbers.map(|k| survey.after[k].translation.vector - survey.before[k].translation.vector);
            let moved: Vec<_> = moved.collect();
            MovedDrive { name: drive.name.clone(), n_submaps: moved.len(), moved_m: rms(&moved) }
        });
        let residuals = |accuracy: &Accuracy, point_use: PointUse| {
            let n_points = points.iter().filter(|point| point.point.point_use == point_use).count();
            let means = means.iter().filter(|mean| mean.residual.point_use == point_use);
            PointResiduals::new(accuracy, n_points, &means.collect::<Vec<_>>())
        };
        let largest = |axis: usize| survey.sigma_m.iter().map(|sigma| sigma[axis]).fold(0.0, f64::max);
        Self {
            out,
            n_submaps: submaps.all.len(),
            drives: drives.collect(),
            pairs: pairs(submaps, survey),
            control: residuals(&accuracy.points.control, PointUse::Control),
            check: residuals(&accuracy.points.check, PointUse::Check),
            heights: accuracy.heights.clone(),
            largest_sigma_m: [largest(0), largest(1)],
        }
    }

    /// The answer as text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} drives, {} submaps", self.drives.len(), self.n_submaps);
        for MovedDrive { name, n_submaps, moved_m: [horizontal, up] } in &self.drives {
            let _ =
                writeln!(text, "{name}: {n_submaps} submaps, moved {horizontal:.3} m horizontally, {up:.3} m up (RMS)");
        }
        for Pair { drives: [a, b], n_matches, n_refused, before_m, after_m } in &self.pairs {
            let _ = writeln!(
                text,
                "{a} and {b}: {n_matches} matches, {n_refused} refused; apart horizontally and up {:.3} m and {:.3} m before, {:.3} m and \
                 {:.3} m after (RMS)",
                before_m[0], before_m[1], after_m[0], after_m[1]
            );
        }
        for (name, residuals) in [("control points", &self.control), ("check points", &self.check)] {
            if residuals.n_points > 0 {
                text.push_str(&residuals.text(name));
            }
        }
        for heights in &self.heights {
            let _ = writeln!(text, "{heights}");
        }
        let [horizontal, up] = self.largest_sigma_m;
        let _ = writeln!(text, "largest standard deviation of a submap: {horizontal:.3} m horizontally, {up:.3} m up");
        let _ = writeln!(text, "{}", self.out.display());
        text
    }
}

impl PointResiduals {
    /// The residuals of points of one use. `n_points` counts the points of the table.
    fn new(accuracy: &Accuracy, n_points: usize, means: &[&MeanResidual]) -> Self {
        let rmse = |axis: &AxisAccuracy| (axis.n > 0).then_some(axis.rmse_m);
        Self {
            n_points,
            n_seen: means.len(),
            n_refused: means.iter().filter(|mean| !mean.agrees).count(),
            rmse_m: accuracy.axes.each_ref().map(rmse),
            accuracy: accuracy.clone(),
        }
    }

    fn text(&self, name: &str) -> String {
        let Self { n_points, n_seen, n_refused, accuracy, .. } = self;
        let refused = if *n_refused > 0 { format!(", {n_refused} refused") } else { String::new() };
        format!("{name}: {n_seen} of {n_points} seen{refused}\n") + &accuracy.text(name)
    }
}

fn pairs(submaps: &Submaps, survey: &Survey) -> Vec<Pair> {
    let n = submaps.drives.len();
    let mut pairs = Vec::new();
    for (a, b) in (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))) {
        let of_pair = survey.matches.iter().filter(|found| {
            let relative = &found.measured.relative;
            (submaps.all[relative.target].drive, submaps.all[relative.source].drive) == (a, b)
        });
        let (agreeing, refused): (Vec<_>, Vec<_>) = of_pair.partition(|found| found.agrees);
        if agreeing.is_empty() && refused.is_empty() {
            continue;
        }
        let apart = |poses: &[geometry::Pose]| {
            rms(&agreeing.iter().map(|found| disagreement(&found.measured.relative, poses)).collect::<Vec<_>>())
        };
        pairs.push(Pair {
            drives: [a, b].map(|drive| submaps.drives[drive].name.clone()),
            n_matches: agreeing.len() + refused.len(),
            n_refused: refused.len(),
            before_m: apart(&survey.before),
            after_m: apart(&survey.after),
        });
    }
    pairs
}

/// Root mean square of vectors, horizontally and up.
fn rms(vectors: &[geometry::Vector3<f64>]) -> [f64; 2] {
    let mean = |square: fn(&geometry::Vector3<f64>) -> f64| {
        (vectors.iter().map(square).sum::<f64>() / vectors.len().max(1) as f64).sqrt()
    };
    [mean(|v| v.xy().norm_squared()), mean(|v| v.z * v.z)]
}

/// Drives and points that do not fit.
pub fn doubts(submaps: &Submaps, survey: &Survey, points: &[ControlPoint]) -> Vec<String> {
    let mut doubts = Vec::new();
    for (index, drive) in submaps.drives.iter().enumerate().filter(|_| submaps.drives.len() > 1) {
        let of_drive = |found: &&Weighed<adjustment::Match>| {
            let relative = &found.measured.relative;
            [relative.target, relative.source].iter().any(|k| submaps.all[*k].drive == index)
        };
        let all: Vec<_> = survey.matches.iter().filter(of_drive).collect();
        let n_agreeing = all.iter().filter(|found| found.agrees).count();
        if n_agreeing == 0 {
            let reason = match all.len() {
                0 => "has no street in common with another drive".to_owned(),
                n => format!("contradicts the other drives in all of {n} matches"),
            };
            doubts.push(format!("drive {:?} {reason}; it is not tied to them", drive.name));
        }
    }
    for (index, point) in points.iter().enumerate().filter(|(_, point)| point.is_control()) {
        let seen: Vec<&Weighed<SeenControl>> =
            survey.control.iter().filter(|seen| seen.measured.point == index).collect();
        let name = &point.point.name;
        if seen.is_empty() {
            doubts.push(format!("control point {name:?} is in no submap; it has no effect"));
        } else if !seen.iter().any(|seen| seen.agrees) {
            let off = seen[0].measured.residual_m(&survey.after);
            let axes = ["east", "north", "up"].iter().zip(off);
            let axes = axes.filter_map(|(axis, off)| Some(format!("{axis} {:.3} m", off?)));
            let axes = axes.collect::<Vec<_>>().join(", ");
            doubts
                .push(format!("control point {name:?} contradicts the other measurements by {axes}; it was not used"));
        }
    }
    doubts
}
