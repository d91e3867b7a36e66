//! Events about the progress of a run: the progress of the stages, and their notes.

use crate::log::{Json, LogFormat};
use crate::plan::Plan;
use crate::slowest::Dataflow;
use crate::stage_figures::StageFigures;
use crate::stage_process::StageProcess;
use run::Mode;
use run::health::{Activity, Health};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Interval of the table. A table that changes more often cannot be read.
const TABLE_EVERY: Duration = Duration::from_millis(500);
/// Interval of lines, for a log that people read.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Interval of JSON events, for programs.
const JSON_EVERY: Duration = Duration::from_secs(1);

/// Width of the progress bar, characters.
const BAR: usize = 20;

/// Reports progress from time to time.
pub struct Progress {
    every: Duration,
    mode: Mode,
    dataflow: Dataflow,
    begun: Instant,
    last: Option<Instant>,
    rates: Rates,
    reported_notes: BTreeSet<String>,
}

impl Progress {
    /// Progress at the interval of the format.
    pub fn new(format: LogFormat, plan: &Plan) -> Self {
        let every = match format {
            LogFormat::Json => JSON_EVERY,
            LogFormat::Text if format.is_live_table() => TABLE_EVERY,
            LogFormat::Text => LINE_EVERY,
        };
        Self {
            every,
            mode: plan.context.mode,
            dataflow: Dataflow::from_stages(&plan.stages),
            begun: Instant::now(),
            last: None,
            rates: Rates::default(),
            reported_notes: BTreeSet::new(),
        }
    }

    /// Starts the clock: the sources of the run start now.
    pub fn begin(&mut self) {
        self.begun = Instant::now();
    }

    /// Reports new notes, and the progress if the interval has passed.
    pub fn report(&mut self, processes: &[StageProcess]) {
        for process in processes {
            for note in &process.health.notes {
                let text = format!("[{}] {note}", process.name);
                if self.reported_notes.insert(text.clone()) {
                    tracing::info!(kind = "note", stage = process.name, note, "{text}");
                }
            }
        }
        let last = *self.last.get_or_insert(self.begun);
        if last.elapsed() >= self.every {
            self.last = Some(Instant::now());
            self.report_now(processes);
        }
    }

    /// Reports the progress.
    pub fn report_now(&mut self, processes: &[StageProcess]) {
        let health: Vec<&Health> = processes.iter().map(|process| &process.health).collect();
        let slowest = self.dataflow.slowest(&health).map(|index| processes[index].name.as_str()).unwrap_or_default();
        let share = health.iter().map(|health| health.progress).fold(1.0, f64::min).clamp(0.0, 1.0);
        let mut line = match self.mode {
            Mode::Offline => self.line(share, processes),
            Mode::Live => self.live_line(&health),
        };
        if !slowest.is_empty() {
            line.push_str("  slowest: ");
            line.push_str(slowest);
        }
        tracing::info!(kind = "progress", share, slowest, stages = %Json(&figures(processes)), "{line}");
    }

    /// The progress of the stage that lags most, in drive time.
    fn line(&self, share: f64, processes: &[StageProcess]) -> String {
        let elapsed = self.begun.elapsed().as_secs_f64();
        let left = if share > 0.0 {
            format!("{:.0} s left", elapsed * (1.0 - share) / share)
        } else {
            let waits: Vec<String> = processes.iter().filter_map(start_state).collect();
            if waits.is_empty() { "starting".to_owned() } else { format!("starting: {}", waits.join(", ")) }
        };
        let filled = (share * BAR as f64) as usize;
        let bar = "#".repeat(filled);
        let rest = "-".repeat(BAR - filled);
        format!("[{bar}{rest}] {:3.0} %  {elapsed:.0} s  {left}", share * 100.0)
    }

    /// The line of a live run, which has no end: rates since the last line, and the lag of the last stage.
    fn live_line(&mut self, health: &[&Health]) -> String {
        let elapsed = self.begun.elapsed().as_secs_f64();
        let (Some(source), Some(sink)) = (health.first(), health.last()) else { return String::new() };
        let rates = self.rates.update(elapsed, source.ticks, sink.points);
        let newest = health.iter().filter_map(|health| health.drive_time).max();
        let lag_s = newest.zip(sink.drive_time).map_or(0.0, |(newest, own)| newest.saturating_sub(own) as f64 * 1e-9);
        let dropped: u64 = health.iter().flat_map(|health| health.inputs.values()).map(|traffic| traffic.dropped).sum();
        let [ticks, points] = rates;
        format!(
            "live  {elapsed:.0} s  {ticks:.1} ticks/s  {:.2} M points/s  lag {lag_s:.1} s  dropped {dropped}",
            points * 1e-6
        )
    }
}

/// Ticks of the source and points of the sink at the last line.
#[derive(Default)]
struct Rates {
    elapsed_s: f64,
    ticks: u64,
    points: u64,
}

impl Rates {
    /// Both rates per second since the last call. Counts of a restarted stage start again at its last barrier.
    fn update(&mut self, elapsed_s: f64, ticks: u64, points: u64) -> [f64; 2] {
        let seconds = (elapsed_s - self.elapsed_s).max(1e-3);
        let rates = [ticks.saturating_sub(self.ticks), points.saturating_sub(self.points)];
        *self = Self { elapsed_s, ticks, points };
        rates.map(|n| n as f64 / seconds)
    }
}

fn figures(processes: &[StageProcess]) -> Vec<StageFigures> {
    let newest = processes.iter().filter_map(|process| process.health.drive_time).max();
    let figures = |process: &StageProcess| {
        let health = process.health.clone();
        let lag_s = newest.zip(health.drive_time).map(|(newest, own)| newest.saturating_sub(own) as f64 * 1e-9);
        StageFigures {
            name: process.name.clone(),
            activity: health.activity,
            ticks: health.ticks,
            points: health.points,
            lag_s,
            barrier: health.barrier,
            step: health.step,
            age: health.age,
            inputs: health.inputs,
            outputs: health.outputs,
            arrivals: health.arrivals,
            waiting: health.waiting,
            cpu_s: health.usage.cpu_s,
            rss_bytes: health.usage.rss_bytes,
        }
    };
    processes.iter().map(figures).collect()
}

/// The reason why a stage is not ready.
fn start_state(process: &StageProcess) -> Option<String> {
    match &process.health.activity {
        Activity::Connecting(topic) => Some(format!("{} waits for {topic}", process.name)),
        Activity::Starting => Some(format!("{} starts", process.name)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_since_the_last_line() {
        let mut rates = Rates::default();
        assert_eq!(rates.update(2.0, 20, 4000), [10.0, 2000.0]);
        assert_eq!(rates.update(4.0, 60, 4000), [20.0, 0.0]);
        assert_eq!(rates.update(5.0, 50, 5000), [0.0, 1000.0], "the source was restarted");
    }
}
