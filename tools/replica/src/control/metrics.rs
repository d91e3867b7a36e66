//! Metrics of the stages and topics of a run, computed from heartbeats.

mod heartbeat_pair;
mod heartbeats;

pub use heartbeats::Heartbeats;

use super::attach::Run;
use heartbeat_pair::HeartbeatPair;
use run::health::{Activity, Latency, Traffic};
use run::wiring::Wiring;
use serde::Serialize;
use std::path::PathBuf;

/// Metrics of a run.
#[derive(Serialize)]
pub struct RunMetrics {
    /// Its output folder.
    pub run: PathBuf,
    /// Whether its supervisor is running.
    pub alive: bool,
    /// Process id of the supervisor.
    pub supervisor: u32,
    /// Number of restarts, by faults and by swaps.
    pub started_anew: u32,
    /// Shared memory that the run has touched, bytes.
    pub shared_memory_bytes: u64,
    /// Metrics of the stages, in the order of the dataflow.
    pub stages: Vec<StageMetrics>,
    /// Metrics of the topics, in the order of the dataflow.
    pub topics: Vec<TopicMetrics>,
}

/// Metrics of one stage. `None` before its first heartbeat.
#[derive(Serialize)]
pub struct StageMetrics {
    /// Name of its table in the launch file.
    pub name: String,
    /// Current activity.
    pub activity: Option<Activity>,
    /// Ticks completed since the start of the drive.
    pub ticks: Option<u64>,
    /// Ticks per second.
    pub ticks_per_s: Option<f64>,
    /// Points processed.
    pub points: Option<u64>,
    /// Points per second.
    pub points_per_s: Option<f64>,
    /// Drive time of the most advanced stage (the source) minus drive time of this stage, s.
    pub lag_s: Option<f64>,
    /// Share of the drive, 0 to 1.
    pub progress: Option<f64>,
    /// Last barrier whose state is saved.
    pub barrier: Option<u64>,
    /// Duration of steps that had input.
    pub step: Option<Latency>,
    /// Time from the start of a tick in the source to its end in this stage.
    pub age: Option<Latency>,
    /// CPU use, %; 100 is one core.
    pub cpu_percent: Option<f64>,
    /// Resident memory, bytes, including touched shared memory.
    pub rss_bytes: Option<u64>,
    /// Largest resident memory so far, bytes.
    pub peak_rss_bytes: Option<u64>,
}

/// Metrics of one topic.
#[derive(Serialize)]
pub struct TopicMetrics {
    /// Its name.
    pub topic: String,
    /// The stage that publishes it.
    pub producer: String,
    /// Version of the message type.
    pub version: u32,
    /// Bytes of a message header.
    pub header_bytes: usize,
    /// Bytes of a row.
    pub row_bytes: usize,
    /// Largest number of rows of a message.
    pub max_rows: usize,
    /// Capacity of the queue of a consumer, messages.
    pub queue_bound: usize,
    /// Traffic published since the start of the drive.
    pub published: Option<Traffic>,
    /// Messages per second.
    pub messages_per_s: Option<f64>,
    /// Rows per second.
    pub rows_per_s: Option<f64>,
    /// Bytes of rows per second.
    pub bytes_per_s: Option<f64>,
    /// Messages that the slowest consumer has not received yet.
    pub waiting: Option<u64>,
    /// Its consumers.
    pub consumers: Vec<ConsumerMetrics>,
}

/// Metrics of a topic at one of its consumers.
#[derive(Serialize)]
pub struct ConsumerMetrics {
    /// The stage.
    pub stage: String,
    /// Messages that are received and wait for a step.
    pub queue: Option<u64>,
    /// Time from publication to delivery to a step.
    pub latency: Option<Latency>,
}

impl RunMetrics {
    /// Computes the metrics from the heartbeats of the stages, in the order of the wiring.
    pub fn new(run: &Run, heartbeats: &[HeartbeatPair]) -> Self {
        let Wiring { supervisor, attempt, ref stages, .. } = run.wiring;
        let newest = heartbeats.iter().filter_map(|heartbeats| heartbeats.last.as_ref()?.drive_time).max();
        Self {
            run: run.output.clone(),
            alive: run.is_alive(),
            supervisor,
            started_anew: attempt,
            shared_memory_bytes: run.domain().map_or(0, |domain| domain.used_bytes()),
            stages: stages
                .iter()
                .zip(heartbeats)
                .map(|(stage, heartbeats)| StageMetrics::new(&stage.name, heartbeats, newest))
                .collect(),
            topics: topics(&run.wiring, heartbeats),
        }
    }
}

impl StageMetrics {
    fn new(name: &str, heartbeats: &HeartbeatPair, newest: Option<i64>) -> Self {
        let last = heartbeats.last.as_ref();
        let drive_time = last.and_then(|health| health.drive_time);
        let lag = newest.zip(drive_time).map(|(newest, own)| newest.saturating_sub(own) as f64 * 1e-9);
        Self {
            name: name.to_owned(),
            activity: last.map(|health| health.activity.clone()),
            ticks: last.map(|health| health.ticks),
            ticks_per_s: heartbeats.rate(|health| health.ticks as f64),
            points: last.map(|health| health.points),
            points_per_s: heartbeats.rate(|health| health.points as f64),
            lag_s: lag,
            progress: last.map(|health| health.progress),
            barrier: last.map(|health| health.barrier),
            step: last.map(|health| health.step),
            age: last.map(|health| health.age),
            cpu_percent: heartbeats.rate(|health| health.usage.cpu_s * 100.0),
            rss_bytes: last.map(|health| health.usage.rss_bytes),
            peak_rss_bytes: last.map(|health| health.usage.peak_rss_bytes),
        }
    }
}

/// Metrics of the topics of a run. Without heartbeats, only the static ones.
pub fn topics(wiring: &Wiring, heartbeats: &[HeartbeatPair]) -> Vec<TopicMetrics> {
    let none = HeartbeatPair::default();
    let heartbeats_of = |name: &str| {
        let index = wiring.stages.iter().position(|stage| stage.name == name);
        index.and_then(|index| heartbeats.get(index)).unwrap_or(&none)
    };
    let topic = |(producer, wired): (&run::wiring::WiredStage, &run::wiring::WiredTopic)| {
        let name = &wired.channels.topic;
        let heartbeats = heartbeats_of(&producer.name);
        let rate = |count: fn(&Traffic) -> u64| heartbeats.rate(|h| h.outputs.get(name).map_or(0, count) as f64);
        let consumers = wiring.stages.iter().filter(|stage| stage.inputs.contains(name)).map(|stage| {
            let arrivals = heartbeats_of(&stage.name).last.as_ref().and_then(|health| health.arrivals.get(name));
            ConsumerMetrics {
                stage: stage.name.clone(),
                queue: arrivals.map(|arrivals| arrivals.queue),
                latency: arrivals.map(|arrivals| arrivals.latency),
            }
        });
        TopicMetrics {
            topic: name.clone(),
            producer: producer.name.clone(),
            version: wired.table.version,
            header_bytes: wired.table.header_bytes,
            row_bytes: wired.table.row_bytes,
            max_rows: wired.table.max_rows,
            queue_bound: wired.messages().queue,
            published: heartbeats.last.as_ref().and_then(|health| health.outputs.get(name).cloned()),
            messages_per_s: rate(|traffic| traffic.messages),
            rows_per_s: rate(|traffic| traffic.rows),
            bytes_per_s: rate(|traffic| traffic.bytes),
            waiting: heartbeats.last.as_ref().and_then(|health| health.waiting.get(name).copied()),
            consumers: consumers.collect(),
        }
    };
    wiring.topics().map(topic).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::health::Health;

    fn beat(beat_nanos: u64, ticks: u64, cpu_s: f64) -> Health {
        Health {
            beat_nanos,
            ticks,
            usage: run::process::Usage { cpu_s, ..Default::default() },
            drive_time: Some(ticks as i64 * 100_000_000),
            ..Health::default()
        }
    }

    #[test]
    fn rates_are_taken_between_two_heartbeats() {
        let heartbeats =
            HeartbeatPair { base: Some(beat(1_000_000_000, 40, 1.0)), last: Some(beat(3_000_000_000, 60, 2.0)) };
        let metrics = StageMetrics::new("relay", &heartbeats, Some(6_500_000_000));
        assert_eq!(metrics.ticks_per_s, Some(10.0));
        assert_eq!(metrics.cpu_percent, Some(50.0));
        assert_eq!(metrics.lag_s, Some(0.5));
        let one = StageMetrics::new("relay", &HeartbeatPair { base: None, ..heartbeats.clone() }, None);
        assert_eq!((one.ticks, one.ticks_per_s), (Some(60), None));
        let set_back = HeartbeatPair { base: heartbeats.last, last: Some(beat(4_000_000_000, 10, 0.1)) };
        assert_eq!(StageMetrics::new("relay", &set_back, None).ticks_per_s, Some(0.0));
    }
}
