//! The answer of `replica deliver`.

use super::facts::Facts;
use super::from_above::{FromAbove, LineFile};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use surveying::accuracy::Accuracy;
use surveying::check_points::{Comparison, PointUse};

/// A delivery.
#[derive(Serialize)]
pub struct Delivered<'a> {
    pub out: &'a Path,
    #[serde(flatten)]
    pub facts: Facts<'a>,
    #[serde(flatten)]
    pub others: Others,
}

/// All files except LAS and COPC.
#[derive(Default, Serialize)]
pub struct Others {
    /// Drives of a survey: the path, the objects and the clouds of each are in a folder of its name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<String>,
    /// Files of the path.
    pub path: Vec<&'static str>,
    /// `None` if the clouds have no instances.
    pub n_objects: Option<usize>,
    /// Rasters and lines.
    #[serde(flatten)]
    pub from_above: FromAbove,
    /// Accuracy over the check points.
    pub accuracy: Option<Accuracy>,
    /// Accuracy over the control points of a survey.
    pub control_accuracy: Option<Accuracy>,
    /// Names of the check points without points of the cloud near them.
    pub check_points_outside: Vec<String>,
    #[serde(skip)]
    pub check_points: Option<Comparison>,
    pub cloudcompare: Option<Folder>,
    pub semantic_kitti: Option<Folder>,
}

impl Others {
    pub fn set_check_points(&mut self, comparison: Comparison) {
        self.accuracy = Some(comparison.accuracy.check.clone());
        let has_control = comparison.residuals.iter().any(|residual| residual.point.point_use == PointUse::Control);
        self.control_accuracy = has_control.then(|| comparison.accuracy.control.clone());
        self.check_points_outside = comparison.outside().map(|point| point.name.clone()).collect();
        self.check_points = Some(comparison);
    }
}

/// A folder with clouds or sweeps; of a survey, the folder with the folders of the drives.
#[derive(Serialize)]
pub struct Folder {
    pub folder: PathBuf,
    pub n: usize,
}

impl Delivered<'_> {
    /// The answer as text. `n_tiles` counts the files of points without the octree.
    pub fn text(&self, n_tiles: usize) -> String {
        let Others {
            drives,
            path,
            n_objects,
            from_above,
            check_points,
            check_points_outside,
            cloudcompare,
            semantic_kitti,
            ..
        } = &self.others;
        let mut text = String::new();
        let facts = &self.facts;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} points in {n_tiles} files", facts.n_points);
        let left = &facts.left_out;
        let reasons =
            [(left.without_place, "of clouds without place"), (left.not_finite, "without finite coordinates")];
        for (n, reason) in reasons.into_iter().filter(|(n, _)| *n > 0) {
            let _ = writeln!(text, "left out: {n} points {reason}");
        }
        if !drives.is_empty() {
            let _ = writeln!(text, "drives, with a folder each: {}", drives.join(", "));
        }
        let _ = writeln!(text, "path: {}", path.join(", "));
        let _ = match n_objects {
            Some(n_objects) => writeln!(text, "objects: {n_objects}"),
            None => writeln!(text, "objects: none, the clouds have no instances"),
        };
        if !from_above.rasters.is_empty() {
            let _ = writeln!(text, "rasters: {}", from_above.rasters.join(", "));
            if let Some(completed) = from_above.completed() {
                let _ = writeln!(text, "completed, not measured: {completed}");
            }
            for LineFile { file, n } in &from_above.lines {
                let _ = writeln!(text, "{file}: {n} lines");
            }
        }
        if let Some(comparison) = check_points {
            text.push_str(&comparison.accuracy.text());
        }
        if !check_points_outside.is_empty() {
            let _ = writeln!(text, "check points outside of the cloud: {}", check_points_outside.join(", "));
        }
        for (folder, what) in [(cloudcompare, "clouds"), (semantic_kitti, "sweeps")] {
            if let Some(Folder { folder, n }) = folder {
                let _ = writeln!(text, "{}: {n} {what}", folder.display());
            }
        }
        let _ = writeln!(text, "{}: {}", self.out.display(), facts.frame);
        text
    }
}
