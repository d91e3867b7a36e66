//! The heartbeat: a stage's report to its supervisor, five times a second, from its own thread.

use crate::histogram::Histogram;
use crate::process::{Usage, monotonic_nanos, usage};
use doubts::DoubtKind;
use ipc::{Domain, LatestPublisher};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// Interval of the heartbeat: at most a tenth of the time after which the supervisor assumes a hang, so that a few lost
/// beats raise no alarm.
pub const HEARTBEAT: Duration = Duration::from_millis(200);

/// Activity of a stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case", tag = "kind", content = "on")]
pub enum Activity {
    /// Reading settings, calibration and models.
    #[default]
    Starting,
    /// Waiting for other processes; the field is the topic that is not connected yet.
    Connecting(String),
    /// Ready to start.
    Ready,
    /// Waiting for input on this topic.
    Waiting(String),
    /// Running a step.
    Working,
    /// Waiting for room at a consumer of this topic.
    Blocked(String),
    /// A source, paused after a barrier that the supervisor requested.
    Paused,
    /// Writing its state at a barrier.
    Saving,
    /// Everything is published; waiting until consumers have taken it.
    Draining,
    /// All ticks are processed.
    Done,
}

/// Every screen and log uses these words.
impl fmt::Display for Activity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Starting => f.write_str("starting"),
            Self::Connecting(topic) => write!(f, "connecting to {topic}"),
            Self::Ready => f.write_str("ready"),
            Self::Waiting(topic) => write!(f, "waiting for input {topic}"),
            Self::Working => f.write_str("working"),
            Self::Blocked(topic) => write!(f, "waiting for output {topic}"),
            Self::Paused => f.write_str("paused"),
            Self::Saving => f.write_str("saving"),
            Self::Draining => f.write_str("draining"),
            Self::Done => f.write_str("done"),
        }
    }
}

/// Messages of one topic, received or published.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Messages.
    pub messages: u64,
    /// Rows.
    pub rows: u64,
    /// Bytes of rows.
    pub bytes: u64,
    /// Sequence number of the next message.
    pub next_seq: u64,
    /// [`messages::Envelope::epoch`] of the producer.
    pub epoch: u32,
    /// Live, inputs only: messages that were dropped for newer ones or published while this stage was down.
    pub dropped: u64,
}

/// Statistics of durations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Latency {
    /// Number of durations.
    pub count: u64,
    /// Mean, ms.
    #[serde(default)]
    pub mean_ms: f64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Longest, ms.
    pub max_ms: f64,
}

impl From<&Histogram> for Latency {
    fn from(h: &Histogram) -> Self {
        Self {
            count: h.count(),
            mean_ms: h.mean_ms(),
            p50_ms: h.percentile_ms(0.5),
            p99_ms: h.percentile_ms(0.99),
            max_ms: h.max_ms(),
        }
    }
}

/// Delivery of the messages of an input topic to the steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Arrivals {
    /// Messages that have arrived and wait for the step of their tick.
    pub queue: u64,
    /// Time from the publication of a message to its delivery to a step.
    pub latency: Latency,
}

/// A doubt as a stage reports it: a reason not to rely on results as they are. A run with doubts ends with exit code 3.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportedDoubt {
    /// Name in snake case, unique in the stage.
    pub name: String,
    /// The size of the doubt, in the unit that the text states: a share of points, a standard deviation.
    pub size: f64,
    /// States what is doubtful, its size, the limit that it exceeds and what to do.
    pub text: String,
}

impl ReportedDoubt {
    /// The kind of the doubt. `None`: a third-party stage has stated it.
    pub fn kind(&self) -> Option<DoubtKind> {
        DoubtKind::from_name(&self.name)
    }
}

/// One heartbeat.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Health {
    /// Number of this beat.
    pub beat: u64,
    /// Monotonic clock at this beat, ns: a rate is the difference of a counter between two beats divided by the
    /// difference of their times.
    pub beat_nanos: u64,
    /// Current activity.
    pub activity: Activity,
    /// Ticks finished since the drive's start.
    pub ticks: u64,
    /// Rises with all progress: ticks, published messages.
    pub progress_mark: u64,
    /// Drive time at the first tick, ns since the Unix epoch.
    pub drive_begin: Option<i64>,
    /// Drive time at the last tick, ns since the Unix epoch.
    pub drive_time: Option<i64>,
    /// Time at which this process finished its first tick, ns of the monotonic clock, which all processes share.
    pub first_tick_nanos: Option<u64>,
    /// Time at which this process finished its last tick, ns of the monotonic clock.
    pub last_tick_nanos: Option<u64>,
    /// Share of the drive that the source had read at the last tick.
    pub progress: f64,
    /// Whether this is a source that was drained before the end of the drive.
    pub drained: bool,
    /// Last barrier whose state is on disk.
    pub barrier: u64,
    /// Traffic by input topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// Traffic by output topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// Delivery by input topic.
    pub arrivals: BTreeMap<String, Arrivals>,
    /// Messages that the slowest consumer has not taken yet, by output topic.
    pub waiting: BTreeMap<String, u64>,
    /// Points processed: rows of the first input topic; for a source, rows of the first output topic.
    pub points: u64,
    /// Duration of steps that had input.
    pub step: Latency,
    /// Time from the start of a tick at the source to its end here.
    pub age: Latency,
    /// Named counters.
    pub counters: BTreeMap<String, u64>,
    /// Texts for the operator.
    pub notes: Vec<String>,
    /// Reasons not to rely on results as they are.
    pub doubts: Vec<ReportedDoubt>,
    /// The error that ended the stage, if it failed. It is also in the log, unless the disk is full.
    #[serde(default)]
    pub error: Option<String>,
    /// Processor time, memory, files.
    #[serde(flatten)]
    pub usage: Usage,
    /// Largest [`Usage::private_bytes`] at a beat.
    pub peak_private_bytes: u64,
    /// Seconds in which the stage's own thread ran no step, by reason, in the words of [`Activity`].
    pub waits: BTreeMap<String, f64>,
    /// The part of the processor time spent on loans, sending, waiting and receiving, s.
    #[serde(default)]
    pub transport_cpu_s: f64,
}

/// State shared by the stage's own thread and the thread of the heartbeat.
#[derive(Default)]
pub struct Pulse {
    health: Mutex<Health>,
    progress_mark: AtomicU64,
    is_ending: AtomicBool,
    /// The thread that publishes the heartbeat.
    thread: OnceLock<std::thread::Thread>,
}

impl Pulse {
    /// The report under construction.
    pub fn update(&self) -> MutexGuard<'_, Health> {
        // A panic in another thread ends the process; the report stays readable until then.
        self.health.lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// Sets the activity.
    pub fn set(&self, activity: Activity) {
        self.update().activity = activity;
    }
    /// Sets the activity and publishes it at once, because another process waits for it.
    pub fn announce(&self, activity: Activity) {
        self.set(activity);
        self.beat_now();
    }
    /// Publishes a beat at once, because the supervisor waits for its content.
    pub fn beat_now(&self) {
        if let Some(thread) = self.thread.get() {
            thread.unpark();
        }
    }
    /// Reports progress.
    pub fn mark_progress(&self) {
        self.progress_mark.fetch_add(1, Ordering::Relaxed);
    }
    /// The progress mark, which rises with all progress.
    pub fn progress(&self) -> u64 {
        self.progress_mark.load(Ordering::Relaxed)
    }
    fn report(&self) -> Health {
        let usage = usage();
        let mut health = self.update();
        health.beat += 1;
        health.beat_nanos = monotonic_nanos();
        health.progress_mark = self.progress();
        health.usage = usage;
        health.peak_private_bytes = health.peak_private_bytes.max(usage.private_bytes);
        health.clone()
    }
}

/// Shortest life of a process. The supervisor polls every 50 ms and connects when it finds the publisher, so the report
/// of a process that fails at once and ends earlier would be lost; its log has the same error. (A process that succeeds
/// waits until a heartbeat has been received.)
const MIN_LIFETIME: Duration = Duration::from_millis(250);

/// Publishes beats until dropped; the last beat carries the final figures.
pub struct Heartbeat {
    pulse: Arc<Pulse>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Heartbeat {
    /// Starts the thread. The service is `<stage>.health`.
    pub fn start(domain: &Domain, stage: &str, pulse: Arc<Pulse>) -> std::io::Result<Self> {
        let domain = domain.clone();
        let stage = stage.to_owned();
        let shared = Arc::clone(&pulse);
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
            let begun = std::time::Instant::now();
            loop {
                let last = shared.is_ending.load(Ordering::Acquire);
                let beat = serde_json::to_vec(&shared.report()).map_err(|error| error.to_string());
                if let Err(error) = beat.and_then(|beat| publisher.publish(&beat).map_err(|error| error.to_string())) {
                    tracing::error!("heartbeat failed: {error}");
                }
                if last {
                    std::thread::sleep(MIN_LIFETIME.saturating_sub(begun.elapsed()));
                    return;
                }
                std::thread::park_timeout(HEARTBEAT);
            }
        })?;
        // A pulse has one heartbeat; a second one would only be published later.
        let _ = pulse.thread.set(thread.thread().clone());
        Ok(Self { pulse, thread: Some(thread) })
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.pulse.is_ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the heartbeat thread panicked");
            }
        }
    }
}
