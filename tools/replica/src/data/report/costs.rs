//! What the stages did with their time, and their progress and memory over the run.

use super::finished_run::FinishedRun;
use chart::{Axis, BarRow, COLORS, Chart, Series};
use run::summary::{StageSummary, Summary};
use std::collections::BTreeMap;
use std::path::Path;

/// Working, waiting for output, waiting for input, all else.
const PIECES: [(&str, &str); 4] =
    [(COLORS[0], "working"), (COLORS[1], "waiting for output"), (COLORS[6], "waiting for input"), ("#b9bec8", "other")];
/// Points of a line of a chart.
const MAX_VERTICES: usize = 400;

/// Colors and names of the pieces of the bars.
pub fn legend() -> impl Iterator<Item = (String, String)> {
    PIECES.iter().map(|(color, name)| ((*color).to_owned(), (*name).to_owned()))
}

/// Seconds of a stage by [`PIECES`] except the last.
pub fn pieces_s(stage: &StageSummary) -> [f64; 3] {
    let waits = |kind: &str| stage.waits.iter().filter(|(why, _)| why.starts_with(kind)).map(|(_, s)| s).sum::<f64>();
    let working_s = stage.step.mean_ms * 1e-3 * stage.step.count as f64;
    [working_s, waits("waiting for output"), waits("waiting for input")]
}

/// A bar for each stage over the time of the run.
pub fn bars(summary: &Summary) -> String {
    let wall_s = summary.total.wall_s.max(1e-3);
    let row = |stage: &StageSummary| {
        let mut from = 0.0;
        let mut pieces = Vec::new();
        for (seconds, (color, _)) in pieces_s(stage).into_iter().chain([f64::INFINITY]).zip(PIECES) {
            let to = (from + seconds).min(wall_s);
            if to > from {
                pieces.push(([from, to], color.to_owned()));
            }
            from = to;
        }
        BarRow { name: stage.name.clone(), pieces, text: format!("{:.1} s CPU", stage.cpu_s) }
    };
    let rows: Vec<BarRow> = summary.stages.iter().map(row).collect();
    chart::bars(&rows, [0.0, wall_s], ["0 s", &format!("{wall_s:.1} s")])
}

/// Drive time and memory over the time of the run. `None` for a run of few seconds, or live.
pub fn over_time(run: &FinishedRun) -> Option<String> {
    let lines = Lines::read(&run.folder.join("run/costs.csv"))?;
    let chart = |label: &str, of: fn(&Sample) -> f64| {
        let series = |(index, (stage, samples)): (usize, (&String, &Vec<Sample>))| {
            let step = samples.len().div_ceil(MAX_VERTICES).max(1);
            let points = samples.iter().step_by(step).map(|sample| [sample.wall_s, of(sample)]);
            Series::line(stage.as_str(), COLORS[index % COLORS.len()], points.collect())
        };
        let series: Vec<Series> = lines.0.iter().enumerate().map(series).collect();
        let points = || series.iter().flat_map(Series::points);
        let x = Axis::new("s of the run", [0.0, points().map(|[x, _]| *x).fold(1.0, f64::max)]);
        let y = Axis::from_zero(label, points().map(|[_, y]| *y));
        Chart { size: [820.0, 170.0], ..Chart::new("", x, y, series) }
    };
    let charts = [
        chart("drive time, s", |sample| sample.drive_s),
        chart("resident memory, MB (shared memory counts in each stage)", |sample| sample.bytes * 1e-6),
    ];
    Some(chart::sheet(&charts, 1))
}

struct Sample {
    wall_s: f64,
    drive_s: f64,
    bytes: f64,
}

/// The lines of `run/costs.csv` by stage.
struct Lines(BTreeMap<String, Vec<Sample>>);

impl Lines {
    /// `None` if no stage has four lines.
    fn read(path: &Path) -> Option<Self> {
        let text = std::fs::read_to_string(path).ok()?;
        let mut lines: BTreeMap<String, Vec<Sample>> = BTreeMap::new();
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let [wall, stage, drive, _, _, bytes] = cells.as_slice() else { continue };
            if let (Ok(wall_s), Ok(drive_s), Ok(bytes)) = (wall.parse(), drive.parse(), bytes.parse()) {
                lines.entry((*stage).to_owned()).or_default().push(Sample { wall_s, drive_s, bytes });
            }
        }
        lines.values().any(|samples| samples.len() >= 4).then_some(Self(lines))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::health::Latency;

    #[test]
    fn bar_of_a_stage_is_divided_by_what_it_waited_for() {
        let waits =
            [("waiting for input sweep", 2.0), ("waiting for output submap", 1.5), ("waiting for output b", 0.5)];
        let step = Latency { count: 100, mean_ms: 10.0, ..Latency::default() };
        let waits = waits.map(|(why, seconds)| (why.to_owned(), seconds)).into();
        let stage = StageSummary { name: "a".to_owned(), step, waits, ..StageSummary::default() };
        assert_eq!(pieces_s(&stage), [1.0, 2.0, 2.0]);
    }
}
