//! The report as Markdown and JSON.

use super::machine::Machine;
use super::profile::{self, ProcessProfile};
use super::series::{Series, Spread};
use files::calendar::date_from_days;
use run::summary::{StageSummary, Summary};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::Path;
use std::time::SystemTime;

/// All measurements, and the machine.
#[derive(Clone, Serialize, Deserialize)]
pub struct Report {
    /// Day of the first run, UTC.
    pub date: String,
    /// See [`Machine`].
    pub machine: Machine,
    /// Launch file, as it was given.
    pub launch_file: String,
    runs: u32,
    /// Runs of each configuration.
    pub series: Vec<Series>,
    /// Profiles of the first configuration, if requested.
    pub profiles: Vec<ProcessProfile>,
}

const HEAD: &str = "| value | median | min | max |\n|---|---|---|---|\n";
const STAGES_HEAD: &str = "| stage | M points/s | CPU s | CPU ns/point | transport CPU s | step p50 / p99 / max ms | \
    age p50 / p99 / max ms | peak RSS MB | MB in |\n|---|---|---|---|---|---|---|---|---|\n";
/// Shortest wait that is listed, s.
const MIN_WAIT_S: f64 = 0.1;
const USE_HEAD: &str =
    "| stage | private MB | page faults | read MB | written MB | waiting s, by reason |\n|---|---|---|---|---|---|\n";
const NOTES: &str = "\
- *CPU* is user and system time of all stages, from their start to their end. The time of the supervisor is separate and \
counts from the start of the run.\n\
- *Transport CPU* is the CPU time of the stages' own threads in loaning, publishing, waiting for and receiving messages and \
ticks, including the kernel. It does not contain page faults in a step.\n\
- *Age* is the time from the start of a tick in the source to its end in the stage: at the last stage, the end-to-end latency. \
Offline, the source runs ahead until the queues are full, so age mostly measures the length of the queues.\n\
- *Peak RSS* counts shared memory in every process that touched it, so the sum is larger than the memory of the run.\n\
- *Private* memory is that which no other process shares, at its largest heartbeat. *Read* and *written* are bytes by calls, of \
files and sockets.\n\
- *Waiting* is time in which the stage's own thread did no step, in the last run: reasons of at least 0.1 s.\n\
- *Handed over* counts the bytes of rows once per consumer, all by reference.\n";

impl Report {
    /// A report with the date of today.
    pub fn new(launch_file: &Path, runs: u32, machine: Machine, series: Vec<Series>) -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let (year, month, day) = date_from_days((since.as_secs() / 86_400) as i64);
        let date = format!("{year:04}-{month:02}-{day:02}");
        Self { date, machine, launch_file: launch_file.display().to_string(), runs, series, profiles: Vec::new() }
    }

    /// Whether all runs processed the same data.
    pub fn runs_agree(&self) -> bool {
        let mut runs = self.series.iter().flat_map(|series| &series.runs);
        let first = runs.next().map(Summary::processed);
        runs.all(|run| Some(run.processed()) == first)
    }

    /// Markdown, with the table of the stages for the first configuration or for all.
    pub fn markdown(&self, all_stages: bool) -> String {
        let mut text = self.head();
        for (index, series) in self.series.iter().enumerate() {
            // Writing to a string cannot fail, here and below.
            let _ = write!(text, "\n## {}\n\n{HEAD}{}", series.configuration, end_to_end(series));
            if all_stages || index == 0 {
                let _ = write!(text, "\n{STAGES_HEAD}{}\n{USE_HEAD}{}", stages(series), uses(series));
            }
        }
        text += &self.comparison();
        if let (false, Some(run)) =
            (self.profiles.is_empty(), self.series.first().and_then(|series| series.runs.first()))
        {
            text += &profile::markdown(&self.profiles, run.stages.iter().map(|stage| stage.name.as_str()));
        }
        text + "\n## Definitions\n\n" + NOTES
    }

    fn head(&self) -> String {
        let Machine { cpu, cores, memory_bytes, kernel, load, commit, version } = &self.machine;
        let warning = if self.runs_agree() { "" } else { "\n**The runs processed different data.**\n" };
        format!(
            "# {} at {commit}, {}\n\n{cpu}, {cores} cores, {:.1} GiB, Linux {kernel}; programs {version}; load before the first run {load:.2}. \
             Medians of {} runs of each configuration, interleaved, after one run that is not measured.\n{warning}",
            self.launch_file,
            self.date,
            *memory_bytes as f64 / (1_u64 << 30) as f64,
            self.runs
        )
    }

    /// Compares the numbers of cores.
    fn comparison(&self) -> String {
        let mut text = String::new();
        let mut line = |what: &str, a: &Series, b: &Series| {
            let ratio = |value: fn(&Summary) -> f64| b.median(value) / a.median(value).max(f64::MIN_POSITIVE);
            let difference = b.median(|run| run.total.cpu_s) - a.median(|run| run.total.cpu_s);
            let _ = writeln!(
                text,
                "| {what} | {:.2} | {:.2} ({difference:+.2} s) | {:.2} | {:.2} |",
                ratio(|run| run.total.points_per_s),
                ratio(|run| run.total.cpu_s),
                ratio(|run| run.peak_rss_bytes() as f64),
                ratio(|run| run.total.latency.p50_ms),
            );
        };
        for a in &self.series {
            for b in &self.series {
                let x = a.configuration;
                let y = b.configuration;
                if x.cores < y.cores {
                    line(&format!("{y} / {x}"), a, b);
                }
            }
        }
        if text.is_empty() {
            return text;
        }
        let head = "| | points/s | CPU | peak RSS, sum | age p50 at the sink |\n|---|---|---|---|---|\n";
        format!("\n## Side by side\n\n{head}{text}")
    }
}

fn end_to_end(series: &Series) -> String {
    let mut text = String::new();
    let mut row = |name: &str, digits: usize, value: &dyn Fn(&Summary) -> f64| {
        let Spread { median, min, max } = series.spread(value);
        let _ = writeln!(text, "| {name} | {median:.digits$} | {min:.digits$} | {max:.digits$} |");
    };
    row("wall s", 2, &|run| run.total.wall_s);
    row("times real time", 2, &|run| run.total.times_real_time);
    row("M points/s", 3, &|run| run.total.points_per_s * 1e-6);
    row("CPU s", 2, &|run| run.total.cpu_s);
    row("CPU ns/point", 0, &|run| run.total.cpu_s * 1e9 / (run.total.points as f64).max(1.0));
    row("transport CPU s", 3, &Summary::transport_cpu_s);
    row("transport share of CPU, %", 2, &|run| 100.0 * run.transport_cpu_s() / run.total.cpu_s);
    row("supervisor, % of a core", 2, &|run| 100.0 * run.total.supervisor_cpu_s / run.total.wall_s);
    row("MB handed over by reference", 0, &|run| run.bytes_handed_over() as f64 * 1e-6);
    row("messages handed over", 0, &|run| run.messages_handed_over() as f64);
    row("peak shared memory, MB", 0, &|run| run.total.peak_shared_memory_bytes as f64 * 1e-6);
    row("peak RSS, sum of stages, MB", 0, &|run| run.peak_rss_bytes() as f64 * 1e-6);
    row("age at the sink p50, ms", 0, &|run| run.total.latency.p50_ms);
    row("age at the sink p99, ms", 0, &|run| run.total.latency.p99_ms);
    row("age at the sink max, ms", 0, &|run| run.total.latency.max_ms);
    text
}

/// Memory, files, and what the stages waited for.
fn uses(series: &Series) -> String {
    let Some(last) = series.runs.last() else { return String::new() };
    let mut text = String::new();
    for (index, stage) in last.stages.iter().enumerate() {
        let median = |value: &dyn Fn(&StageSummary) -> u64| {
            series.median(|run| run.stages.get(index).map_or(0.0, |stage| value(stage) as f64))
        };
        let mut waits: Vec<_> = stage.waits.iter().filter(|(_, seconds)| **seconds >= MIN_WAIT_S).collect();
        waits.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let waits: Vec<String> = waits.into_iter().map(|(reason, seconds)| format!("{seconds:.1} {reason}")).collect();
        let _ = writeln!(
            text,
            "| {} | {:.0} | {:.0} | {:.0} | {:.0} | {} |",
            stage.name,
            median(&|stage| stage.peak_private_bytes) * 1e-6,
            median(&|stage| stage.page_faults),
            median(&|stage| stage.read_bytes) * 1e-6,
            median(&|stage| stage.written_bytes) * 1e-6,
            waits.join(", "),
        );
    }
    text
}

fn stages(series: &Series) -> String {
    let mut text = String::new();
    let names = series.runs.first().map(|run| run.stages.iter().map(|stage| stage.name.clone()).collect::<Vec<_>>());
    for (index, name) in names.unwrap_or_default().iter().enumerate() {
        let median =
            |value: &dyn Fn(&StageSummary) -> f64| series.median(|run| run.stages.get(index).map_or(0.0, value));
        let _ = writeln!(
            text,
            "| {name} | {:.3} | {:.2} | {:.0} | {:.3} | {:.1} / {:.1} / {:.1} | {:.0} / {:.0} / {:.0} | {:.0} | {:.0} |",
            median(&|stage| stage.points_per_s * 1e-6),
            median(&|stage| stage.cpu_s),
            median(&StageSummary::cpu_nanos_per_point),
            median(&|stage| stage.transport_cpu_s),
            median(&|stage| stage.step.p50_ms),
            median(&|stage| stage.step.p99_ms),
            median(&|stage| stage.step.max_ms),
            median(&|stage| stage.age.p50_ms),
            median(&|stage| stage.age.p99_ms),
            median(&|stage| stage.age.max_ms),
            median(&|stage| stage.peak_rss_bytes as f64 * 1e-6),
            median(&|stage| stage.bytes_in() as f64 * 1e-6),
        );
    }
    text
}
