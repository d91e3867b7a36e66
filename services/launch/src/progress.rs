//! Events about the progress of a run: where the stages are, and the notes that they report.

use crate::log::{Json, LogFormat};
use crate::stage_figures::StageFigures;
use crate::stage_process::StageProcess;
use run::health::Activity;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// A table that changes more often cannot be read.
const TABLE_EVERY: Duration = Duration::from_millis(500);
/// For a log that is read by people.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// For programs.
const JSON_EVERY: Duration = Duration::from_secs(1);

/// Width of the progress bar, characters.
const BAR: usize = 20;

/// Reports progress from time to time.
pub struct Progress {
    every: Duration,
    begun: Instant,
    last: Option<Instant>,
    reported_notes: BTreeSet<String>,
}

impl Progress {
    /// As often as the format is read.
    pub fn new(format: LogFormat) -> Self {
        let every = match format {
            LogFormat::Json => JSON_EVERY,
            LogFormat::Text if format.is_live_table() => TABLE_EVERY,
            LogFormat::Text => LINE_EVERY,
        };
        Self { every, begun: Instant::now(), last: None, reported_notes: BTreeSet::new() }
    }

    /// The sources of the run start now.
    pub fn begin(&mut self) {
        self.begun = Instant::now();
    }

    /// Reports new notes, and the progress if it is time to.
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
        if last.elapsed() < self.every {
            return;
        }
        self.last = Some(Instant::now());
        let share = processes.iter().map(|process| process.health.progress).fold(1.0, f64::min);
        let line = self.line(processes);
        tracing::info!(kind = "progress", share, stages = %Json(&figures(processes)), "{line}");
    }

    /// The progress of the slowest stage, in drive time.
    fn line(&self, processes: &[StageProcess]) -> String {
        let slowest = processes.iter().min_by(|a, b| a.health.progress.total_cmp(&b.health.progress));
        let Some(slowest) = slowest else { return String::new() };
        let share = slowest.health.progress.clamp(0.0, 1.0);
        let elapsed = self.begun.elapsed().as_secs_f64();
        let left =
            if share > 0.0 { format!("{:.0} s left", elapsed * (1.0 - share) / share) } else { "starting".to_owned() };
        let filled = (share * BAR as f64) as usize;
        let waits: Vec<String> = processes.iter().filter_map(start_state).collect();
        let waits = if share > 0.0 || waits.is_empty() { String::new() } else { format!("  {}", waits.join(", ")) };
        format!(
            "[{}{}] {:3.0} %  {elapsed:.0} s  {left}  slowest: {}{waits}",
            "#".repeat(filled),
            "-".repeat(BAR - filled),
            share * 100.0,
            slowest.name
        )
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

/// What a stage that is not ready waits for.
fn start_state(process: &StageProcess) -> Option<String> {
    match &process.health.activity {
        Activity::Connecting(topic) => Some(format!("{} waits for {topic}", process.name)),
        Activity::Starting => Some(format!("{} starts", process.name)),
        _ => None,
    }
}
