//! `replica-lab bench --compare`: which figures of two reports differ by more than the limit and the noise.

mod figure;
mod interval;
mod text;

use super::configuration::Configuration;
use super::report::Report;
use super::series::Series;
use command_line::usage_error::UsageError;
use figure::{Better, Figure, RUN_FIGURES, STAGE_FIGURES};
use interval::Interval;
use run::summary::{Processed, Summary};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Fewest runs of a configuration with a median that is not a mean of the smallest and the largest.
const MIN_RUNS: usize = 3;

/// Reports to compare.
#[derive(Debug, clap::Args)]
pub struct CompareArgs {
    /// Compare two reports (JSON) of this command, the older one first; start nothing
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with_all = ["launch_file", "runs", "cores", "stages", "profile", "out", "overrides"])]
    compare: Option<Vec<PathBuf>>,
    /// Smallest change of a median that counts, in percent (0 to 1000)
    #[arg(long, default_value_t = 5.0, value_name = "PERCENT", value_parser = percent, requires = "compare")]
    limit: f64,
}

impl CompareArgs {
    /// The comparison, if two reports are given. Fails if they cannot be compared.
    pub fn comparison(&self) -> anyhow::Result<Option<Comparison>> {
        let Some([a, b]) = self.compare.as_deref() else { return Ok(None) };
        let [a, b] = [NamedReport::load(a)?, NamedReport::load(b)?];
        Ok(Some(compare(&a, &b, self.limit)?))
    }
}

fn percent(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=1000.0).contains(&value) { Ok(value) } else { Err("must be 0 to 1000".to_owned()) }
}

/// A report and the name by which messages call it.
struct NamedReport {
    name: String,
    report: Report,
}

impl NamedReport {
    fn load(path: &Path) -> anyhow::Result<Self> {
        let name = path.display().to_string();
        let bytes = files::regular_file::read(path).map_err(|cause| UsageError(format!("{name}: {cause}")))?;
        let report = serde_json::from_slice(&bytes)
            .map_err(|cause| UsageError(format!("{name}: not a JSON report of `replica-lab bench`: {cause}")))?;
        Ok(Self { name, report })
    }
}

/// How a figure changed from report A to report B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The medians differ by less than the limit.
    Same,
    /// The medians differ by more than the limit, but runs of one report differ as much.
    Noise,
    /// B is better by more than the limit and the noise.
    Better,
    /// B is worse by more than the limit and the noise.
    Worse,
}

/// A figure of both reports.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Cores of the runs.
    pub configuration: Configuration,
    /// Stage; absent for figures of the whole run.
    pub stage: Option<String>,
    /// Name of the figure.
    pub figure: &'static str,
    /// Median and its interval in report A.
    pub a: Interval,
    /// Median and its interval in report B.
    pub b: Interval,
    /// Change of the median, % of A; absent if A is 0.
    pub change_percent: Option<f64>,
    /// The answer.
    pub verdict: Verdict,
}

/// All figures of two reports.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Limit of the command line, %.
    pub limit_percent: f64,
    /// Differences between the reports that explain changes, such as another processor.
    pub notes: Vec<String>,
    /// Figures, by configuration; the whole run before its stages.
    pub rows: Vec<Row>,
}

impl Comparison {
    /// Whether a figure is worse beyond limit and noise.
    pub fn has_regression(&self) -> bool {
        self.rows.iter().any(|row| row.verdict == Verdict::Worse)
    }
}

/// Compares the configurations that both reports have.
fn compare(a: &NamedReport, b: &NamedReport, limit_percent: f64) -> Result<Comparison, UsageError> {
    let mut found = Vec::new();
    let mut notes = machine_notes(&a.report, &b.report);
    check_configurations(a)?;
    check_configurations(b)?;
    for x in &a.report.series {
        let Some(y) = b.report.series.iter().find(|series| series.configuration == x.configuration) else {
            notes.push(format!("{} is only in A", x.configuration));
            continue;
        };
        check_runs(&a.name, x)?;
        check_runs(&b.name, y)?;
        check_sources(&a.name, x)?;
        check_sources(&b.name, y)?;
        check_same_drive([&a.name, &b.name], &x.runs[0], &y.runs[0])?;
        if x.runs[0].processed() != y.runs[0].processed() {
            notes.push(format!("{}: stages after the source processed different data", x.configuration));
        }
        found.extend(rows(x, y, limit_percent));
    }
    let configurations = |report: &Report| {
        report.series.iter().map(|series| series.configuration.to_string()).collect::<Vec<_>>().join(", ")
    };
    if found.is_empty() {
        return Err(UsageError(format!(
            "no configuration is in both reports: {} has {}, {} has {}; measure both with the same --cores",
            a.name,
            configurations(&a.report),
            b.name,
            configurations(&b.report)
        )));
    }
    Ok(Comparison { limit_percent, notes, rows: found })
}

fn machine_notes(a: &Report, b: &Report) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |what: &str, a: &str, b: &str| {
        if a != b {
            notes.push(format!("{what}: {a} in A, {b} in B"));
        }
    };
    note("launch file", &a.launch_file, &b.launch_file);
    note("processor", &a.machine.cpu, &b.machine.cpu);
    note("cores", &a.machine.cores.to_string(), &b.machine.cores.to_string());
    note("kernel", &a.machine.kernel, &b.machine.kernel);
    for (name, report) in [("A", a), ("B", b)] {
        // A load of one core before the first run: other programs share the machine with the measurement.
        if report.machine.load >= 1.0 {
            notes.push(format!(
                "{name} was measured on a busy machine: load {:.2} before its first run",
                report.machine.load
            ));
        }
    }
    notes
}

/// Reports of older versions have a series for each transport with the same number of cores.
fn check_configurations(report: &NamedReport) -> Result<(), UsageError> {
    let series = &report.report.series;
    let is_repeated = |index: usize| series[..index].iter().any(|s| s.configuration == series[index].configuration);
    match (0..series.len()).find(|index| is_repeated(*index)) {
        None => Ok(()),
        Some(index) => Err(UsageError(format!(
            "{}: two series with {}: written by an older version; measure again",
            report.name, series[index].configuration
        ))),
    }
}

fn check_runs(name: &str, series: &Series) -> Result<(), UsageError> {
    let n = series.runs.len();
    if n >= MIN_RUNS {
        return Ok(());
    }
    Err(UsageError(format!(
        "{name}: {n} run{} with {}: a median needs at least {MIN_RUNS}; measure again with --runs 5",
        if n == 1 { "" } else { "s" },
        series.configuration
    )))
}

/// What the source published: the data of the drive, whatever later stages make of it.
fn source(run: &Summary) -> Vec<(&str, [u64; 3])> {
    let outputs = run.stages.first().map(|stage| &stage.outputs);
    let topics = outputs.into_iter().flatten();
    topics.map(|(topic, moved)| (topic.as_str(), [moved.messages, moved.rows, moved.bytes])).collect()
}

fn check_sources(name: &str, series: &Series) -> Result<(), UsageError> {
    let first = source(&series.runs[0]);
    match series.runs.iter().position(|run| source(run) != first) {
        None => Ok(()),
        Some(index) => Err(UsageError(format!(
            "{name}: runs 1 and {} with {} read different data; measure a drive that does not change",
            index + 1,
            series.configuration
        ))),
    }
}

fn check_same_drive(names: [&str; 2], a: &Summary, b: &Summary) -> Result<(), UsageError> {
    let stages =
        |run: &Summary| run.processed().iter().map(|stage: &Processed<'_>| stage.name.to_owned()).collect::<Vec<_>>();
    let [first, second] = names;
    if stages(a) != stages(b) {
        return Err(UsageError(format!(
            "the reports have different stages: {first} has {}, {second} has {}",
            stages(a).join(", "),
            stages(b).join(", ")
        )));
    }
    if source(a) != source(b) {
        return Err(UsageError(format!(
            "the reports are of different drives: {first} read {:.1} s with {} points, {second} read {:.1} s with {} points",
            a.total.drive_s, a.total.points, b.total.drive_s, b.total.points
        )));
    }
    Ok(())
}

/// All figures of one configuration.
fn rows(a: &Series, b: &Series, limit_percent: f64) -> Vec<Row> {
    let row = |stage: Option<&str>, figure: &Figure, value: &dyn Fn(&Summary) -> f64| {
        let [a_values, b_values] = [a, b].map(|series| Interval::from_values(series.runs.iter().map(value).collect()));
        let change = b_values.median - a_values.median;
        Row {
            configuration: a.configuration,
            stage: stage.map(str::to_owned),
            figure: figure.name,
            a: a_values,
            b: b_values,
            change_percent: (a_values.median != 0.0).then(|| 100.0 * change / a_values.median.abs()),
            verdict: verdict(&a_values, &b_values, figure, limit_percent),
        }
    };
    let mut rows: Vec<Row> = RUN_FIGURES.iter().map(|(figure, value)| row(None, figure, value)).collect();
    for (index, stage) in a.runs[0].stages.iter().enumerate() {
        rows.extend(STAGE_FIGURES.iter().map(|(figure, value)| {
            // A run that lacks the stage would have been refused: its stages differ.
            row(Some(&stage.name), figure, &|run| run.stages.get(index).map_or(0.0, value))
        }));
    }
    rows
}

/// A change counts if it is larger than the limit and the smallest change of the figure, if the intervals of the medians do not overlap,
/// and if it is larger than the wider interval.
///
/// The last rule is for few runs, whose intervals are short by chance. For normal noise of 10 % and a limit of 5 %, one row in 50 is a false alarm
/// with three runs, and one in 1000 with five.
fn verdict(a: &Interval, b: &Interval, figure: &Figure, limit_percent: f64) -> Verdict {
    let change = b.median - a.median;
    if change.abs() <= figure.floor || change.abs() <= a.median.abs() * limit_percent / 100.0 {
        return Verdict::Same;
    }
    let is_apart = a.low > b.high || b.low > a.high;
    if !is_apart || change.abs() <= a.width().max(b.width()) {
        return Verdict::Noise;
    }
    let is_better = match figure.better {
        Better::Higher => change > 0.0,
        Better::Lower => change < 0.0,
    };
    if is_better { Verdict::Better } else { Verdict::Worse }
}

#[cfg(test)]
mod tests;
