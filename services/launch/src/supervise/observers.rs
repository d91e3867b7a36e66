//! Observers that follow a run without changing it: recorder, metrics, costs, progress.

use super::error::SuperviseError;
use crate::costs::Costs;
use crate::log::LogFormat;
use crate::metrics::{Metrics, StageHealth};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::recorder::Recorder;
use crate::run_folder::RunFolder;
use crate::stage_process::StageProcess;
use ipc::Domain;
use run::health::Health;
use run::{Mode, Outcome};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// All observers of a run.
pub struct Observers {
    recorder: Option<Recorder>,
    metrics: Metrics,
    /// `None` in live mode: a run without end would fill the disk.
    costs: Option<Costs>,
    progress: Progress,
}

/// Opens the metrics. Fails if the file cannot be written.
pub fn metrics(file: Option<&Path>) -> Result<Metrics, SuperviseError> {
    Ok(Metrics::new(file)?)
}

impl Observers {
    /// The observers, not started yet.
    pub fn new(format: LogFormat, metrics: Metrics, record: Option<PathBuf>, plan: &Plan, folder: &RunFolder) -> Self {
        Self {
            recorder: record.map(|file| Recorder::new(plan, file)),
            metrics,
            costs: (plan.context.mode == Mode::Offline).then(|| Costs::new(folder.costs())),
            progress: Progress::new(format, plan),
        }
    }

    /// Whether the run is recorded.
    pub fn is_recording(&self) -> bool {
        self.recorder.is_some()
    }

    /// Starts a new attempt, which has been wired.
    pub fn start_attempt(&mut self, attempt: u32) -> Result<(), SuperviseError> {
        if let Some(recorder) = &mut self.recorder {
            recorder.start(attempt)?;
        }
        Ok(())
    }

    /// Whether sources may start.
    pub fn are_ready(&self) -> bool {
        self.recorder.as_ref().is_none_or(Recorder::is_ready)
    }

    /// Starts the clock of the progress: the sources start now.
    pub fn begin_progress(&mut self) {
        self.progress.begin();
    }

    /// Shows the final state of the stages, which remains on the screen.
    pub fn show_last(&mut self, processes: &[StageProcess]) {
        self.progress.report_now(processes);
    }

    /// Shows and writes the figures that are due.
    pub fn update(&mut self, processes: &[StageProcess], domain: &Domain, restarts: u32) {
        let health = || processes.iter().map(|process| StageHealth { stage: &process.name, health: &process.health });
        self.progress.report(processes);
        self.metrics.update(health(), || domain.used_bytes(), restarts);
        if let Some(costs) = &mut self.costs {
            costs.update(health());
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.observe();
            recorder.report_end();
        }
    }

    /// Writes the final figures.
    pub fn write_last(&mut self, health: &BTreeMap<String, Health>, domain: &Domain, restarts: u32) {
        let health = || health.iter().map(|(stage, health)| StageHealth { stage, health });
        self.metrics.write(health(), domain.used_bytes(), restarts);
        if let Some(costs) = &mut self.costs {
            costs.write(health());
        }
    }

    /// Waits for the recorder; `true` if the recording is complete or was not requested.
    pub fn finish_recording(&mut self, outcome: Outcome) -> bool {
        let finished = self.recorder.take().map_or(Ok(()), |recorder| recorder.finish(outcome));
        if let Err(error) = &finished {
            tracing::error!("{error}");
        }
        finished.is_ok()
    }
}
