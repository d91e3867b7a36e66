//! How the stages spent their time.

use chart::{BarRow, COLORS};
use run::summary::{StageSummary, Summary};

/// Pieces of a bar: working, waiting for output, waiting for input, other.
const PIECES: [(&str, &str); 4] =
    [(COLORS[0], "working"), (COLORS[1], "waiting for output"), (COLORS[6], "waiting for input"), ("#b9bec8", "other")];

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
