//! What a run has left in its output, as a row of the table.

use super::drives::BatchDrive;
use run::Outcome;
use run::summary::Summary;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;

/// Progress of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveOutcome {
    /// Finished, and no stage doubts its results.
    Complete,
    /// Finished, with doubts.
    Doubts,
    /// Its run failed.
    Failed,
    /// Its run has begun and has not finished: it is running, or was interrupted.
    Unfinished,
    /// No run has begun.
    #[default]
    NotRun,
}

impl DriveOutcome {
    /// All outcomes.
    pub const ALL: [Self; 5] = [Self::Complete, Self::Doubts, Self::Failed, Self::Unfinished, Self::NotRun];

    /// The word in the table.
    pub fn text(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Doubts => "doubts",
            Self::Failed => "failed",
            Self::Unfinished => "unfinished",
            Self::NotRun => "not_run",
        }
    }
}

/// The result of a drive. Figures are from `summary.json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Name of the drive.
    pub drive: String,
    /// Progress of the drive.
    pub outcome: DriveOutcome,
    /// Drive time that was processed, s.
    pub drive_s: f64,
    /// Time from the last start of the sources to the end, s.
    pub wall_s: f64,
    /// `drive_s / wall_s`.
    pub times_real_time: f64,
    /// Points of the clouds.
    pub points: u64,
    /// User and system time of all stages since the last start, s.
    pub cpu_s: f64,
    /// Names of the doubts.
    pub doubts: BTreeSet<String>,
    /// Exit code of a run that failed in this batch; `None` if a signal ended it.
    #[serde(skip)]
    pub exit_code: Option<i32>,
}

impl Row {
    /// Reads the files of the drive's run.
    pub fn read(drive: &BatchDrive) -> Self {
        let row = Self { drive: drive.name.clone(), ..Self::default() };
        let Ok(summary) = Summary::load(&drive.output) else {
            let outcome = if Summary::file(&drive.output).exists() {
                // The summary of another version.
                DriveOutcome::Failed
            } else if drive.output.join("run/settings.json").exists() {
                DriveOutcome::Unfinished
            } else if drive.log.exists() {
                // The start was refused.
                DriveOutcome::Failed
            } else {
                DriveOutcome::NotRun
            };
            return Self { outcome, ..row };
        };
        let doubts: BTreeSet<String> = summary.doubts().map(|(_, doubt)| doubt.name.clone()).collect();
        let outcome = match summary.outcome {
            Outcome::Done if doubts.is_empty() => DriveOutcome::Complete,
            Outcome::Done => DriveOutcome::Doubts,
            Outcome::Drained | Outcome::Stopped => DriveOutcome::Unfinished,
            Outcome::Failed => DriveOutcome::Failed,
        };
        let total = summary.total;
        Self {
            outcome,
            drive_s: total.drive_s,
            wall_s: total.wall_s,
            times_real_time: total.times_real_time,
            points: total.points,
            cpu_s: total.cpu_s,
            doubts,
            ..row
        }
    }

    /// Marks the drive as failed, whatever its run has left.
    pub fn fail(&mut self, exit_code: Option<i32>) {
        self.outcome = DriveOutcome::Failed;
        self.exit_code = exit_code;
    }

    /// Whether the run has finished.
    pub fn is_finished(&self) -> bool {
        matches!(self.outcome, DriveOutcome::Complete | DriveOutcome::Doubts)
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.drive, self.outcome.text())?;
        if !self.is_finished() {
            return Ok(());
        }
        let wall_s = self.wall_s;
        let points = self.points as f64 * 1e-6;
        write!(
            f,
            ", {:.1} s of drive in {wall_s:.1} s ({:.2} times real time), {points:.2} M points",
            self.drive_s, self.times_real_time
        )?;
        if !self.doubts.is_empty() {
            write!(f, ", doubts: {}", doubt_names(&self.doubts))?;
        }
        Ok(())
    }
}

/// Names of doubts, separated by spaces.
pub fn doubt_names(doubts: &BTreeSet<String>) -> String {
    doubts.iter().map(String::as_str).collect::<Vec<_>>().join(" ")
}
