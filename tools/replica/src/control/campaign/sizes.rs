//! Time, memory and shared memory of a job, from the drives that are finished.

use super::campaign_file::Campaign;
use crate::control::batch::plan::expected_seconds;
use run::Outcome;
use run::summary::Summary;

/// Reserve of the time limit: other drives of the same length differ in points and objects, and nodes in speed.
const TIME_RESERVE: f64 = 2.0;
/// Reserve of the memory: submaps of other streets have more points.
const MEMORY_RESERVE: f64 = 1.25;
/// Memory of the supervisor, the batch and the report, MB.
const OWN_MEMORY_MB: f64 = 300.0;
/// Shortest time limit, minutes: limits of SLURM are whole minutes, and a run needs some seconds to start and to drain.
const MIN_MINUTES: u32 = 5;
/// Seconds before the time limit at which a run starts to drain, unless set: the time of a few submaps.
pub const DRAIN_S: u32 = 120;

/// Sizes of the jobs: one array has the same for all drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Drives that are finished.
    pub n_measured: usize,
    /// Time limit, minutes.
    pub minutes: Option<u32>,
    /// Memory, MB, of all processes and with the shared memory.
    pub memory_mb: Option<u32>,
    /// Shared memory in /dev/shm, MB.
    pub shared_memory_mb: Option<u32>,
}

impl Sizes {
    /// The settings of the campaign, and estimates for absent ones. Without a finished drive they stay absent.
    pub fn new(campaign: &Campaign) -> Self {
        let summaries = campaign.drives.iter().filter_map(|drive| Summary::load(&drive.output).ok());
        let done: Vec<Summary> = summaries.filter(|summary| summary.outcome == Outcome::Done).collect();
        let seconds = expected_seconds(&campaign.drives).unwrap_or_default();
        let longest_s = seconds.into_iter().fold(0.0, f64::max);
        let shared_mb = done.iter().map(shared_memory_mb).fold(0.0, f64::max);
        let memory_mb = done.iter().map(memory_mb).fold(0.0, f64::max);
        let drain_s = f64::from(campaign.slurm.drain_s.unwrap_or(DRAIN_S));
        let minutes = ((longest_s * TIME_RESERVE + drain_s) / 60.0).ceil() as u32;
        let known = |value: u32| (!done.is_empty()).then_some(value);
        Self {
            n_measured: done.len(),
            minutes: campaign.slurm.minutes.or_else(|| known(minutes.max(MIN_MINUTES))),
            memory_mb: campaign.slurm.memory_mb.or_else(|| known((memory_mb * MEMORY_RESERVE + OWN_MEMORY_MB) as u32)),
            shared_memory_mb: known((shared_mb * MEMORY_RESERVE) as u32),
        }
    }
}

fn shared_memory_mb(summary: &Summary) -> f64 {
    summary.total.peak_shared_memory_bytes as f64 * 1e-6
}

/// Private memory of all stages at their largest, and the shared memory once.
fn memory_mb(summary: &Summary) -> f64 {
    let private: u64 = summary.stages.iter().map(|stage| stage.peak_private_bytes).sum();
    private as f64 * 1e-6 + shared_memory_mb(summary)
}
