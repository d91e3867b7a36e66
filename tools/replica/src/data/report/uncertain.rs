//! Uncertainty: counters of losses, standard deviations over the drive, colors by camera.

use super::cloud_survey::CloudSurvey;
use super::finished_run::FinishedRun;
use chart::{Axis, COLORS, Chart, Series};
use drive::Drive;
use serde::Serialize;

/// Parts of the names of counters of lost, damaged or ambiguous data.
const OF_LOSSES: [&str; 27] = [
    "bad_",
    "bridged",
    "clipped",
    "cut_",
    "damaged",
    "dead_",
    "degenerate",
    "dropped",
    "early",
    "foreign",
    "large_offset",
    "late",
    "lost",
    "masked",
    "missing",
    "not_",
    "out_of",
    "outside",
    "partial",
    "refused",
    "restarted",
    "saturated",
    "skipped",
    "unknown",
    "unread",
    "unseen",
    "without",
];
/// Least number of submaps for a chart over the drive.
const MIN_SUBMAPS: usize = 3;

/// A counter that is not 0.
#[derive(Debug, Serialize)]
pub struct Loss {
    pub stage: String,
    pub counter: String,
    pub n: u64,
}

/// Counters of all stages for lost, damaged or ambiguous data.
pub fn losses(run: &FinishedRun) -> Vec<Loss> {
    let counters =
        run.summary.stages.iter().flat_map(|stage| stage.counters.iter().map(|counter| (&stage.name, counter)));
    let is_loss = |name: &str| OF_LOSSES.iter().any(|part| name.contains(part));
    let found = counters.filter(|(_, (name, n))| **n > 0 && is_loss(name));
    found.map(|(stage, (name, n))| Loss { stage: stage.clone(), counter: name.clone(), n: *n }).collect()
}

/// Share of the points that a camera colored.
#[derive(Debug, Serialize)]
pub struct CameraShare {
    pub camera: String,
    /// Share of all points, 0 to 1.
    pub share: f64,
}

/// Shares by camera; the last one is the share without a color. Empty without colors.
pub fn camera_shares(survey: &CloudSurvey, drive: Option<&Drive>) -> Vec<CameraShare> {
    if survey.by_camera.is_empty() {
        return Vec::new();
    }
    let names: Vec<String> = drive
        .map(|drive| drive.manifest().cameras.iter().map(|entry| entry.name.clone()).collect())
        .unwrap_or_default();
    let n_cameras = names.len().max(survey.by_camera.keys().last().map_or(0, |last| usize::from(*last) + 1));
    let share = |n: u64| n as f64 / survey.n_read.max(1) as f64;
    let of_camera = |index: usize| CameraShare {
        camera: names.get(index).cloned().unwrap_or_else(|| format!("camera {index}")),
        share: share(survey.by_camera.get(&(index as u8)).copied().unwrap_or_default()),
    };
    let mut shares: Vec<CameraShare> = (0..n_cameras).map(of_camera).collect();
    let n_colored: u64 = survey.by_camera.values().sum();
    shares.push(CameraShare { camera: "no camera".to_owned(), share: share(survey.n_read.saturating_sub(n_colored)) });
    shares
}

/// Standard deviations of the submaps over the drive. `None` with few submaps or without placement.
pub fn deviations(run: &FinishedRun) -> Option<String> {
    let clouds = &run.index.as_ref()?.clouds;
    let begin = clouds.first()?.stamp_begin;
    let placed: Vec<(f64, [f64; 3])> = clouds
        .iter()
        .filter_map(|cloud| {
            let [along, across, up] = cloud.sigma_m?;
            let [_, _, heading] = cloud.sigma_rad?;
            let horizontal = f64::from(along).hypot(f64::from(across));
            let at_s = cloud.stamp_begin.saturating_sub(begin) as f64 * 1e-9;
            Some((at_s, [horizontal, f64::from(up), f64::from(heading).to_degrees()]))
        })
        .collect();
    if placed.len() < MIN_SUBMAPS {
        return None;
    }
    let line = |name: &str, color: &'static str, k: usize| {
        Series::line(name, color, placed.iter().map(|(at_s, values)| [*at_s, values[k]]).collect())
    };
    let chart = |label: &str, series: Vec<Series>| {
        let points = || series.iter().flat_map(Series::points);
        let x = Axis::new("s of the drive", [0.0, points().map(|[x, _]| *x).fold(1.0, f64::max)]);
        let y = Axis::from_zero(label, points().map(|[_, y]| *y));
        Chart { size: [820.0, 150.0], ..Chart::new("", x, y, series) }
    };
    let of_position = vec![line("horizontal", COLORS[0], 0), line("height", COLORS[2], 1)];
    let of_heading = vec![line("heading", COLORS[1], 2)];
    Some(chart::sheet(&[chart("m", of_position), chart("degrees", of_heading)], 1))
}
