//! Charts of a trajectory and of its errors.

use super::report::Report;
use chart::{Axis, COLORS, Chart, Series};
use pictures::thinning::thinned;
use scores::trajectory::{PosePair, distances_along, position_errors, rotation_errors};

/// Top view of both trajectories.
pub fn map(report: &Report) -> String {
    let line = |name: &str, color, place: fn(&PosePair) -> [f64; 2]| {
        let points: Vec<[f64; 2]> = report.pairs.iter().map(place).collect();
        Series::line(name, color, thinned(points))
    };
    let truth = line("truth", COLORS[5], |pair| [pair.truth.translation.x, pair.truth.translation.y]);
    let estimate = line("estimate", COLORS[1], |pair| [pair.estimate.translation.x, pair.estimate.translation.y]);
    let first = report.pairs.first().map(|pair| [pair.truth.translation.x, pair.truth.translation.y]);
    let start = Series::dots("start", COLORS[0], first.into_iter().collect());
    Chart::map("Trajectories, top view", ["x, m", "y, m"], vec![truth, estimate, start]).svg()
}

/// Errors along the trajectory, and KITTI's errors by length of the segments.
pub fn errors(report: &Report) -> String {
    let distances = distances_along(&report.pairs);
    let along = Axis::new("distance along the truth, m", [0.0, distances.last().copied().unwrap_or(0.0).max(1.0)]);
    let line_of = |values: &[f64]| thinned(distances.iter().zip(values).map(|(at, value)| [*at, *value]).collect());
    let size = [720.0, 180.0];

    let position = position_errors(&report.pairs);
    let part = |k: usize| -> Vec<f64> {
        let off = |pair: &PosePair| pair.estimate.translation.vector[k] - pair.truth.translation.vector[k];
        report.pairs.iter().map(off).collect()
    };
    let [x, y, z] = [0, 1, 2].map(part);
    let low = [&x, &y, &z].into_iter().flatten().copied().fold(0.0, f64::min);
    let lines = vec![
        Series::thin_line("x", COLORS[6], line_of(&x)),
        Series::thin_line("y", COLORS[2], line_of(&y)),
        Series::thin_line("z", COLORS[3], line_of(&z)),
        Series::line("distance", COLORS[0], line_of(&position)),
    ];
    let mut axis = Axis::from_zero("m", position);
    axis.range[0] = 1.05 * low;
    let upper = Chart { size, ..Chart::new("Position error", along.clone(), axis, lines) };

    let rotation: Vec<f64> = rotation_errors(&report.pairs).into_iter().map(f64::to_degrees).collect();
    let line = vec![Series::line("", COLORS[0], line_of(&rotation))];
    let middle = Chart { size, ..Chart::new("Rotation error", along, Axis::from_zero("degrees", rotation), line) };

    let mut charts = vec![upper, middle];
    let rows = report.segment_rows();
    let translation: Vec<[f64; 2]> =
        rows.iter().filter_map(|row| Some([row.length_m?, row.translation_percent])).collect();
    let rotation: Vec<[f64; 2]> =
        rows.iter().filter_map(|row| Some([row.length_m?, row.rotation_deg_per_100_m])).collect();
    if let [_, .., [last, _]] = translation[..] {
        let top = translation.iter().chain(&rotation).map(|point| point[1]);
        let axis = Axis::from_zero("", top);
        let series = vec![
            Series::line("translation, %", COLORS[0], translation.clone()),
            Series::dots("translation, %", COLORS[0], translation),
            Series::line("rotation, degrees per 100 m", COLORS[1], rotation.clone()),
            Series::dots("rotation, degrees per 100 m", COLORS[1], rotation),
        ];
        let length = Axis::new("length, m", [0.0, 1.05 * last]);
        charts.push(Chart { size, ..Chart::new("Mean error by segment length (KITTI)", length, axis, series) });
    }
    chart::sheet(&charts, 1)
}
