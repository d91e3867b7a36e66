//! Charts of CPU time per sweep and memory of the stages of a run.

use crate::thinning::thinned;
use anyhow::{Context, ensure};
use chart::{Axis, COLORS, Chart, Series};
use files::regular_file;
use scores::Statistics;
use std::path::Path;

/// File to which the supervisor appends about once per second.
const FILE: &str = "run/costs.csv";
/// Columns of the file.
const HEADER: &str = "wall_s,stage,drive_s,ticks,cpu_s,resident_bytes";

/// Totals of a stage at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    drive_s: f64,
    ticks: f64,
    cpu_s: f64,
    resident_mb: f64,
}

/// Samples by stage, in the order of the file.
pub struct CostHistory(Vec<(String, Vec<Sample>)>);

impl CostHistory {
    /// Reads the history of a run; `None` if the file does not exist.
    pub fn read(run: &Path) -> anyhow::Result<Option<Self>> {
        let path = run.join(FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = regular_file::read_to_string(&path).with_context(|| path.display().to_string())?;
        Self::from_csv(&text).with_context(|| path.display().to_string()).map(Some)
    }

    fn from_csv(text: &str) -> anyhow::Result<Self> {
        let header = text.lines().next().unwrap_or_default();
        ensure!(header == HEADER, "line 1: {header}: must be {HEADER}");
        let mut stages: Vec<(String, Vec<Sample>)> = Vec::new();
        for (number, line) in text.lines().enumerate().skip(1) {
            let rule = || {
                format!(
                    "line {}: {line}: must have the six columns of line 1, all numbers except the stage",
                    number + 1
                )
            };
            let columns: Vec<&str> = line.split(',').collect();
            let [_, stage, numbers @ ..] = &columns[..] else { anyhow::bail!(rule()) };
            let numbers: Result<Vec<f64>, _> = numbers.iter().map(|number| number.parse()).collect();
            let Ok([drive_s, ticks, cpu_s, resident]) = <[f64; 4]>::try_from(numbers.with_context(rule)?) else {
                anyhow::bail!(rule())
            };
            let line = Sample { drive_s, ticks, cpu_s, resident_mb: resident * 1e-6 };
            match stages.iter_mut().find(|(name, _)| name == stage) {
                Some((_, lines)) => lines.push(line),
                None => stages.push(((*stage).to_owned(), vec![line])),
            }
        }
        Ok(Self(stages))
    }

    /// Charts of CPU time per sweep and resident memory over the drive, with one line per stage.
    pub fn svg(&self) -> String {
        let end = self.0.iter().flat_map(|(_, lines)| lines).map(|line| line.drive_s).fold(1.0, f64::max);
        let chart = |title: &str, unit: &str, top: f64, of: fn(&[Sample]) -> Vec<[f64; 2]>| {
            let line = |(k, (name, lines)): (usize, &(String, Vec<Sample>))| {
                let points = of(lines).into_iter().map(|[at, value]| [at, value.min(top)]).collect();
                Series::thin_line(name, COLORS[k % COLORS.len()], thinned(points))
            };
            let series = self.0.iter().enumerate().map(line).collect();
            let axis = Axis::from_zero(unit, [top]);
            Chart { size: [720.0, 180.0], ..Chart::new(title, Axis::new("drive, s", [0.0, end]), axis, series) }
        };
        let all = |of: fn(&[Sample]) -> Vec<[f64; 2]>| {
            self.0.iter().flat_map(move |(_, lines)| of(lines)).map(|[_, value]| value)
        };
        // One slow second (a loop closure, a slow disk) must not compress the rest of the chart.
        let top = Statistics::from_values(all(ms_per_tick)).map_or(1.0, |found| (2.0 * found.p95).max(1.0));
        let times =
            chart("CPU time per sweep (values above twice the 95th percentile are cut off)", "ms", top, ms_per_tick);
        let memory = chart("Resident memory", "MB", all(memory).fold(1.0, f64::max), memory);
        chart::sheet(&[times, memory], 1)
    }
}

/// CPU time per tick between consecutive samples. Samples across a restart, and after the last sweep, are left out.
fn ms_per_tick(lines: &[Sample]) -> Vec<[f64; 2]> {
    let is_consecutive = |a: &Sample, b: &Sample| b.drive_s > a.drive_s && b.ticks > a.ticks && b.cpu_s >= a.cpu_s;
    let pairs = lines.windows(2).filter(|pair| is_consecutive(&pair[0], &pair[1]));
    pairs.map(|p| [p[1].drive_s, 1e3 * (p[1].cpu_s - p[0].cpu_s) / (p[1].ticks - p[0].ticks)]).collect()
}

fn memory(lines: &[Sample]) -> Vec<[f64; 2]> {
    lines.iter().map(|line| [line.drive_s, line.resident_mb]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_per_sweep_is_taken_between_consecutive_samples() {
        let text = format!(
            "{HEADER}\n1.0,acquire,0.5,5,0.10,20000000\n1.0,slam_aggregate,0.4,4,0.20,50000000\n\
             2.0,acquire,1.5,15,0.15,20000000\n2.0,slam_aggregate,1.4,14,0.45,60000000\n\
             3.0,slam_aggregate,0.9,9,0.10,60000000\n4.0,slam_aggregate,1.9,19,0.40,61000000\n\
             9.0,slam_aggregate,1.9,20,5.40,61000000\n"
        );
        let costs = CostHistory::from_csv(&text).expect("sound");
        let of = |k: usize| ms_per_tick(&costs.0[k].1);
        assert_eq!(of(0).len(), 1);
        assert!((of(0)[0][1] - 5.0).abs() < 1e-9 && (of(0)[0][0] - 1.5).abs() < 1e-9);
        // The restart between the second and the third sample and the work after the last sweep are left out.
        let slam = of(1);
        assert_eq!(slam.len(), 2);
        assert!((slam[0][1] - 25.0).abs() < 1e-9 && (slam[1][1] - 30.0).abs() < 1e-9);
        let svg = costs.svg();
        assert!(
            svg.contains("slam_aggregate") && svg.contains("CPU time per sweep") && svg.contains("Resident memory")
        );
    }

    #[test]
    fn invalid_line_is_reported() {
        let problem = |text: &str| format!("{:#}", CostHistory::from_csv(text).err().expect("wrong"));
        assert!(problem("a,b\n").contains("line 1: a,b"));
        assert!(problem(&format!("{HEADER}\n1.0,x,1,2,three,4\n")).contains("line 2: 1.0,x,1,2,three,4"));
        assert!(problem(&format!("{HEADER}\n1.0,x,1,2\n")).contains("six columns"));
    }
}
