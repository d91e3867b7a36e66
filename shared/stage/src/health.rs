//! The heartbeat: what a stage tells its supervisor five times a second, from a thread of its own.

use crate::histogram::Histogram;
use crate::process::{Usage, usage};
use ipc::{Domain, LatestPublisher};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A tenth of what the supervisor calls a hang, at most: a few lost beats are no alarm.
pub const HEARTBEAT: Duration = Duration::from_millis(200);

/// What a stage is doing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case", tag = "kind", content = "on")]
pub enum Activity {
    /// Reading settings, calibration, models.
    #[default]
    Starting,
    /// Waiting for the others; what it waits for.
    Connecting(String),
    /// Ready to begin.
    Ready,
    /// Waiting for input on this topic.
    Waiting(String),
    /// In a step.
    Working,
    /// Waiting for room at a consumer of this topic.
    Blocked(String),
    /// Writing its state at a barrier.
    Saving,
    /// Everything is published; waiting until it has been taken.
    Draining,
    /// Through.
    Done,
}

/// Messages of one topic that went in or out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Messages.
    pub messages: u64,
    /// Rows.
    pub rows: u64,
    /// Bytes of rows, shared and not copied.
    pub bytes: u64,
}

/// Durations of a kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// How many.
    pub count: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99 of 100 are shorter, ms.
    pub p99_ms: f64,
    /// Longest, ms.
    pub max_ms: f64,
}

impl From<&Histogram> for Latency {
    fn from(h: &Histogram) -> Self {
        Self { count: h.count(), p50_ms: h.percentile_ms(0.5), p99_ms: h.percentile_ms(0.99), max_ms: h.max_ms() }
    }
}

/// One heartbeat.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Counts the beats.
    pub beat: u64,
    /// What it is doing.
    pub activity: Activity,
    /// Ticks finished, since the drive's start.
    pub ticks: u64,
    /// Rises with everything that the stage gets done: ticks, messages published.
    pub progress_mark: u64,
    /// Drive time at the first tick, ns since the Unix epoch.
    pub drive_begin: Option<i64>,
    /// Drive time at the last tick, ns since the Unix epoch.
    pub drive_time: Option<i64>,
    /// Share of the drive that the source had read at the last tick.
    pub progress: f64,
    /// A source that was asked to end before the drive did.
    pub drained: bool,
    /// Last barrier whose state is on disk.
    pub barrier: u64,
    /// By input topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// By output topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// Points that passed: rows of the first input topic, of a source the first output topic.
    pub points: u64,
    /// Time in one step that had input.
    pub step: Latency,
    /// From the source's beginning of a tick to its end here.
    pub age: Latency,
    /// Named counters.
    pub counters: BTreeMap<String, u64>,
    /// Texts for the operator.
    pub notes: Vec<String>,
    /// User and system time, s.
    pub cpu_s: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
    /// Largest resident memory, bytes.
    pub peak_rss_bytes: u64,
}

/// What the stage's own thread and its heartbeat share.
#[derive(Default)]
pub struct Pulse {
    health: Mutex<Health>,
    progress_mark: AtomicU64,
    quiet: AtomicBool,
}

impl Pulse {
    /// The report under construction.
    pub fn update(&self) -> MutexGuard<'_, Health> {
        // A panic elsewhere ends the process anyway; the report stays readable until then.
        self.health.lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// Sets the activity.
    pub fn set(&self, activity: Activity) {
        self.update().activity = activity;
    }
    /// Something got done.
    pub fn mark_progress(&self) {
        self.progress_mark.fetch_add(1, Ordering::Relaxed);
    }
    fn report(&self) -> Health {
        let Usage { cpu_s, rss_bytes, peak_rss_bytes } = usage();
        let mut health = self.update();
        health.beat += 1;
        health.progress_mark = self.progress_mark.load(Ordering::Relaxed);
        (health.cpu_s, health.rss_bytes, health.peak_rss_bytes) = (cpu_s, rss_bytes, peak_rss_bytes);
        health.clone()
    }
}

/// Beats until dropped; the last beat carries the final figures.
pub struct Heartbeat {
    pulse: Arc<Pulse>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Heartbeat {
    /// Starts the thread. The service is `<stage>.health`.
    pub fn start(domain: &Domain, stage: &str, pulse: Arc<Pulse>) -> std::io::Result<Self> {
        let (domain, stage, shared) = (domain.clone(), stage.to_owned(), Arc::clone(&pulse));
        let thread = std::thread::Builder::new().name("heartbeat".to_owned()).spawn(move || {
            let publisher = domain
                .node(&format!("{stage}-health"))
                .and_then(|node| LatestPublisher::open(&node, &format!("{stage}.health")));
            let publisher = match publisher {
                Ok(publisher) => publisher,
                Err(error) => {
                    tracing::error!("no heartbeat: {error}");
                    return;
                }
            };
            loop {
                let last = shared.quiet.load(Ordering::Acquire);
                let beat = serde_json::to_vec(&shared.report()).map_err(|error| error.to_string());
                if let Err(error) = beat.and_then(|beat| publisher.publish(&beat).map_err(|error| error.to_string())) {
                    tracing::error!("heartbeat failed: {error}");
                }
                if last {
                    return;
                }
                std::thread::park_timeout(HEARTBEAT);
            }
        })?;
        Ok(Self { pulse, thread: Some(thread) })
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.pulse.quiet.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the heartbeat thread panicked");
            }
        }
    }
}
