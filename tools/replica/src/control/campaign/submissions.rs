//! `OUT/campaign/submissions.json`: the jobs of the campaign.

use super::campaign_file::Campaign;
use super::slurm::{self, JobState, SlurmError};
use anyhow::{Context, ensure};
use files::atomic_file::write_atomic;
use files::regular_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The whole file.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Submissions {
    /// Names of the drives; a task has the index of its drive.
    pub drives: Vec<String>,
    /// All submissions, the last one at the end.
    pub jobs: Vec<Submission>,
    /// The scripts as they were written, by name: others were changed by a person and are kept.
    pub scripts: BTreeMap<String, String>,
}

/// A submission.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Submission {
    /// Number of the array job.
    pub array: String,
    /// Indices of its drives.
    pub drives: Vec<usize>,
    /// Number of the job after all drives.
    pub finish: Option<String>,
}

impl Submissions {
    fn file(campaign: &Campaign) -> PathBuf {
        campaign.own_folder().join("submissions.json")
    }

    /// Reads the file; empty before the first submission.
    pub fn load(campaign: &Campaign) -> anyhow::Result<Self> {
        let file = Self::file(campaign);
        if !file.exists() {
            return Ok(Self::default());
        }
        let bytes = regular_file::read(&file).with_context(|| file.display().to_string())?;
        serde_json::from_slice(&bytes).with_context(|| file.display().to_string())
    }

    /// Reads the file of a campaign that was submitted with these drives.
    pub fn load_submitted(campaign: &Campaign) -> anyhow::Result<Self> {
        let submissions = Self::load(campaign)?;
        ensure!(
            !submissions.jobs.is_empty(),
            "{}: nothing was submitted\nhint: replica campaign submit {}",
            campaign.out.display(),
            files::shell::path(&campaign.file)
        );
        let names: Vec<&str> = campaign.drives.iter().map(|drive| drive.name.as_str()).collect();
        ensure!(
            submissions.drives == names,
            "{}: the drives differ from the submitted ones in {}; submit the campaign again",
            campaign.file.display(),
            Self::file(campaign).display()
        );
        Ok(submissions)
    }

    /// Writes the file.
    pub fn save(&self, campaign: &Campaign) -> anyhow::Result<()> {
        let file = Self::file(campaign);
        let text = serde_json::to_vec_pretty(self)?;
        write_atomic(&file, &text).with_context(|| file.display().to_string())
    }

    /// What SLURM says about the last submission of each drive, and about the last job after all drives.
    pub fn states(&self) -> Result<States, SlurmError> {
        let mut states = States { drives: vec![None; self.drives.len()], finish: None };
        for submission in &self.jobs {
            let tasks = slurm::states(&submission.array)?;
            for drive in &submission.drives {
                let job = format!("{}_{drive}", submission.array);
                let state = tasks.get(&job).cloned();
                if let Some(slot) = states.drives.get_mut(*drive) {
                    *slot = Some(Task { job, state });
                }
            }
            if let Some(finish) = &submission.finish {
                let state = slurm::states(finish)?.remove(finish);
                states.finish = Some(Task { job: finish.clone(), state });
            }
        }
        Ok(states)
    }
}

/// States of all jobs.
#[derive(Debug)]
pub struct States {
    /// The last task of each drive; `None`: never submitted.
    pub drives: Vec<Option<Task>>,
    /// The last job after all drives.
    pub finish: Option<Task>,
}

/// A task, with SLURM's words about it; SLURM forgets a task minutes after its end.
#[derive(Clone, Debug, Serialize)]
pub struct Task {
    /// `JOB_TASK` or `JOB`.
    pub job: String,
    /// `None`: SLURM no longer knows it.
    pub state: Option<JobState>,
}

impl Task {
    /// Whether it waits, runs, or will run again.
    pub fn is_active(&self) -> bool {
        self.state.as_ref().is_some_and(JobState::is_active)
    }
}
