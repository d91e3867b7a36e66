//! A cluster that works through equal drives, event by event.
//!
//! Assumptions: a machine runs one drive at a time. It fails at random times (exponential), loses what its run did since the last barrier, and is
//! repaired. The engine notices the failure later; then the drive is the next one to start, on any machine. All runs share the bandwidth of
//! the disk equally; a run that gets less than it needs becomes slower in proportion. A faulty drive fails in the middle of each attempt.

use crate::costs::RunCosts;
use random::Random;
use std::collections::VecDeque;

/// Where a run continues after its machine failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    /// At its last barrier.
    FromBarrier,
    /// At its first sweep.
    FromBeginning,
}

/// Machines, their failures, and the disk that they share.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    /// Machines.
    pub n_machines: usize,
    /// Mean working time between two failures of a machine, s.
    pub mean_time_to_failure_s: f64,
    /// Time without the machine after a failure, s.
    pub repair_s: f64,
    /// Time until the engine starts the drive of a failed machine again, s. SLURM on loopback took 35 s.
    pub detection_s: f64,
    /// Time from the start of a job to the first sweep, s.
    pub start_s: f64,
    /// Machine time between two barriers, s.
    pub barrier_s: f64,
    /// Where a run continues.
    pub restart: Restart,
    /// Share of the drives that cannot be processed, 0 to 1.
    pub faulty_share: f64,
    /// Attempts at a faulty drive.
    pub attempts: u32,
    /// Bytes a second of the shared disk.
    pub disk_bytes_per_s: f64,
}

impl Default for Cluster {
    fn default() -> Self {
        Self {
            n_machines: 100,
            mean_time_to_failure_s: f64::INFINITY,
            repair_s: 4.0 * 3600.0,
            detection_s: 35.0,
            start_s: 5.0,
            barrier_s: 5.0,
            restart: Restart::FromBarrier,
            faulty_share: 0.0,
            attempts: 3,
            disk_bytes_per_s: f64::INFINITY,
        }
    }
}

/// The end of a campaign.
#[derive(Clone, Copy, Debug)]
pub struct Ending {
    /// Time from the first start to the last end, h.
    pub hours: f64,
    /// Time of machines with a job, h.
    pub machine_hours: f64,
    /// Work that was done again or for nothing, as a share of the work that was needed.
    pub repeated_share: f64,
    /// Machines that failed with or without a job.
    pub n_failures: usize,
    /// Drives without a result.
    pub n_failed_drives: usize,
}

/// A drive that waits or runs. Work is machine time at full speed, s.
#[derive(Clone, Copy, Debug)]
struct Job {
    /// Start of a job and what a restart reads again.
    start_s: f64,
    done_s: f64,
    is_faulty: bool,
    attempts: u32,
}

#[derive(Clone, Copy, Debug)]
struct Machine {
    job: Option<Job>,
    fails_at_s: f64,
    /// Ready again from this time on; the past for a machine that works.
    ready_at_s: f64,
}

/// Runs the campaign. The same arguments give the same ending.
pub fn simulate(cluster: &Cluster, drive: &RunCosts, n_drives: usize) -> Ending {
    let mut random = Random::new(1);
    let next_failure = |random: &mut Random, now_s: f64| {
        now_s - cluster.mean_time_to_failure_s * f64::from(1.0 - random.unit()).max(f64::MIN_POSITIVE).ln()
    };
    let mut waiting: VecDeque<Job> = (0..n_drives)
        .map(|_| Job {
            start_s: cluster.start_s,
            done_s: 0.0,
            is_faulty: f64::from(random.unit()) < cluster.faulty_share,
            attempts: 0,
        })
        .collect();
    // Drives of failed machines, until the engine notices.
    let mut lost: VecDeque<(f64, Job)> = VecDeque::new();
    let machine = |random: &mut Random| {
        // A cluster without failures: infinity times 0 is not a time.
        let fails_at_s =
            if cluster.mean_time_to_failure_s.is_finite() { next_failure(random, 0.0) } else { f64::INFINITY };
        Machine { job: None, fails_at_s, ready_at_s: 0.0 }
    };
    let mut machines: Vec<Machine> = (0..cluster.n_machines).map(|_| machine(&mut random)).collect();
    let bytes_per_s = (drive.read_bytes + drive.disk_bytes) / drive.wall_s;
    let mut now_s = 0.0;
    let mut busy_s = 0.0;
    let mut repeated_s = 0.0;
    let mut n_failures = 0;
    let mut n_failed_drives = 0;
    loop {
        while lost.front().is_some_and(|(at_s, _)| *at_s <= now_s) {
            waiting.extend(lost.pop_front().map(|(_, job)| job));
            waiting.rotate_right(1);
        }
        for machine in machines.iter_mut().filter(|machine| machine.job.is_none() && machine.ready_at_s <= now_s) {
            machine.job = waiting.pop_front();
        }
        let n_active = machines.iter().filter(|machine| machine.job.is_some()).count();
        if n_active == 0 && waiting.is_empty() && lost.is_empty() {
            break;
        }
        let speed = (cluster.disk_bytes_per_s / (bytes_per_s * n_active as f64)).min(1.0);
        // The next end, failure, repair or detection.
        let left_s = |job: &Job| job.start_s + (target_s(job, drive) - job.done_s) / speed;
        let ends = machines.iter().filter_map(|machine| machine.job.as_ref()).map(|job| now_s + left_s(job));
        let repairs = machines.iter().map(|machine| machine.ready_at_s).filter(|at_s| *at_s > now_s);
        let detections = lost.iter().map(|(at_s, _)| *at_s);
        let failures = machines.iter().map(|machine| machine.fails_at_s);
        let next_s = ends.chain(repairs).chain(detections).chain(failures).fold(f64::INFINITY, f64::min);
        let passed_s = next_s - now_s;
        now_s = next_s;
        busy_s += passed_s * n_active as f64;
        for machine in &mut machines {
            if let Some(mut job) = machine.job.take() {
                let starting_s = passed_s.min(job.start_s);
                job.start_s -= starting_s;
                job.done_s += (passed_s - starting_s) * speed;
                // A millisecond: sums of times are not exact.
                let has_ended = job.done_s >= target_s(&job, drive) - 1e-3;
                if has_ended && job.is_faulty {
                    repeated_s += job.done_s;
                    job = Job { start_s: cluster.start_s, done_s: 0.0, attempts: job.attempts + 1, ..job };
                    if job.attempts < cluster.attempts { waiting.push_back(job) } else { n_failed_drives += 1 }
                } else if !has_ended {
                    machine.job = Some(job);
                }
            }
            if machine.fails_at_s <= now_s {
                n_failures += 1;
                machine.ready_at_s = now_s + cluster.repair_s;
                machine.fails_at_s = next_failure(&mut random, machine.ready_at_s);
                if let Some(job) = machine.job.take() {
                    let kept_s = match cluster.restart {
                        Restart::FromBarrier => (job.done_s / cluster.barrier_s).floor() * cluster.barrier_s,
                        Restart::FromBeginning => 0.0,
                    };
                    repeated_s += job.done_s - kept_s;
                    lost.push_back((
                        now_s + cluster.detection_s,
                        Job { start_s: cluster.start_s, done_s: kept_s, ..job },
                    ));
                }
            }
        }
    }
    Ending {
        hours: now_s / 3600.0,
        machine_hours: busy_s / 3600.0,
        repeated_share: repeated_s / (drive.wall_s * n_drives as f64),
        n_failures,
        n_failed_drives,
    }
}

/// Work at which the job ends.
fn target_s(job: &Job, drive: &RunCosts) -> f64 {
    if job.is_faulty { drive.wall_s / 2.0 } else { drive.wall_s }
}
