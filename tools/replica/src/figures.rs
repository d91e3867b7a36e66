//! What a run's heartbeats say, as rates: of each stage and of each topic.

mod heartbeats;

pub use heartbeats::Heartbeats;

use crate::attach::Run;
use serde::Serialize;
use stage::health::{Activity, Health, Latency, Traffic};
use stage::wiring::Wiring;
use std::path::PathBuf;

/// Two heartbeats of a stage, the earlier one being what rates start from.
#[derive(Clone, Default)]
pub struct Beats {
    /// Where rates start.
    pub base: Option<Health>,
    /// The newest.
    pub last: Option<Health>,
}

impl Beats {
    /// Time between the two, s. `None` as long as there is one or none.
    pub fn seconds(&self) -> Option<f64> {
        let (base, last) = (self.base.as_ref()?, self.last.as_ref()?);
        let nanos = last.beat_nanos.checked_sub(base.beat_nanos).filter(|nanos| *nanos > 0)?;
        Some(nanos as f64 * 1e-9)
    }

    /// How fast a count rises, per second. A restart sets counts back; that is no rate.
    fn rate(&self, count: impl Fn(&Health) -> f64) -> Option<f64> {
        let (base, last) = (self.base.as_ref()?, self.last.as_ref()?);
        Some(((count(last) - count(base)) / self.seconds()?).max(0.0))
    }
}

/// A whole run.
#[derive(Serialize)]
pub struct RunFigures {
    /// Its output folder.
    pub run: PathBuf,
    /// Whether its supervisor is at work.
    pub alive: bool,
    /// Process id of the supervisor.
    pub supervisor: u32,
    /// How often its stages have been started anew, by faults and by swaps.
    pub started_anew: u32,
    /// Shared memory that the run really uses, bytes.
    pub shared_memory_bytes: u64,
    /// In the order of the dataflow.
    pub stages: Vec<StageFigures>,
    /// In the order of the dataflow.
    pub topics: Vec<TopicFigures>,
}

/// One stage. `None` where no heartbeat has come.
#[derive(Serialize)]
pub struct StageFigures {
    /// Its table.
    pub name: String,
    /// What it is doing.
    pub activity: Option<Activity>,
    /// Ticks finished since the drive's start.
    pub ticks: Option<u64>,
    /// Ticks per second.
    pub ticks_per_s: Option<f64>,
    /// Points that passed.
    pub points: Option<u64>,
    /// Points per second.
    pub points_per_s: Option<f64>,
    /// Drive time of the stage that is furthest (the source) minus its own, s.
    pub lag_s: Option<f64>,
    /// Share of the drive, 0 to 1.
    pub progress: Option<f64>,
    /// Last barrier whose state is on disk.
    pub barrier: Option<u64>,
    /// Time in a step that had input.
    pub step: Option<Latency>,
    /// From the source's beginning of a tick to its end here.
    pub age: Option<Latency>,
    /// 100 = one core.
    pub cpu_percent: Option<f64>,
    /// Resident memory, bytes; shared memory that was touched counts too.
    pub rss_bytes: Option<u64>,
    /// Largest resident memory so far, bytes.
    pub peak_rss_bytes: Option<u64>,
}

/// One topic.
#[derive(Serialize)]
pub struct TopicFigures {
    /// Its name.
    pub topic: String,
    /// The stage that writes it.
    pub producer: String,
    /// Version of the message type.
    pub version: u32,
    /// Bytes of a message's fixed part.
    pub header_bytes: usize,
    /// Bytes of a row.
    pub row_bytes: usize,
    /// Rows that fit a message.
    pub max_rows: usize,
    /// Messages that may wait at a consumer.
    pub queue_bound: usize,
    /// What was published since the drive's start.
    pub published: Option<Traffic>,
    /// Messages per second.
    pub messages_per_s: Option<f64>,
    /// Rows per second.
    pub rows_per_s: Option<f64>,
    /// Bytes of rows per second.
    pub bytes_per_s: Option<f64>,
    /// Messages that the slowest consumer has not taken yet.
    pub waiting: Option<u64>,
    /// Those who read it.
    pub consumers: Vec<ConsumerFigures>,
}

/// A topic's messages at one of its consumers.
#[derive(Serialize)]
pub struct ConsumerFigures {
    /// The stage.
    pub stage: String,
    /// Messages that it has taken and that wait for its step.
    pub queue: Option<u64>,
    /// From publication to delivery to a step.
    pub latency: Option<Latency>,
}

impl RunFigures {
    /// From the beats of the stages, in the order of the wiring.
    pub fn new(run: &Run, beats: &[Beats]) -> Self {
        let Wiring { supervisor, attempt, ref stages, .. } = run.wiring;
        let newest = beats.iter().filter_map(|beats| beats.last.as_ref()?.drive_time).max();
        Self {
            run: run.output.clone(),
            alive: run.is_alive(),
            supervisor,
            started_anew: attempt,
            shared_memory_bytes: run.domain().map_or(0, |domain| domain.used_bytes()),
            stages: stages
                .iter()
                .zip(beats)
                .map(|(stage, beats)| StageFigures::new(&stage.name, beats, newest))
                .collect(),
            topics: topics(&run.wiring, beats),
        }
    }
}

impl StageFigures {
    fn new(name: &str, beats: &Beats, newest: Option<i64>) -> Self {
        let last = beats.last.as_ref();
        let drive_time = last.and_then(|health| health.drive_time);
        let lag = newest.zip(drive_time).map(|(newest, own)| newest.saturating_sub(own) as f64 * 1e-9);
        Self {
            name: name.to_owned(),
            activity: last.map(|health| health.activity.clone()),
            ticks: last.map(|health| health.ticks),
            ticks_per_s: beats.rate(|health| health.ticks as f64),
            points: last.map(|health| health.points),
            points_per_s: beats.rate(|health| health.points as f64),
            lag_s: lag,
            progress: last.map(|health| health.progress),
            barrier: last.map(|health| health.barrier),
            step: last.map(|health| health.step),
            age: last.map(|health| health.age),
            cpu_percent: beats.rate(|health| health.cpu_s * 100.0),
            rss_bytes: last.map(|health| health.rss_bytes),
            peak_rss_bytes: last.map(|health| health.peak_rss_bytes),
        }
    }
}

/// The topics of a run; without beats without what beats say.
pub fn topics(wiring: &Wiring, beats: &[Beats]) -> Vec<TopicFigures> {
    let none = Beats::default();
    let beats_of = |name: &str| {
        let index = wiring.stages.iter().position(|stage| stage.name == name);
        index.and_then(|index| beats.get(index)).unwrap_or(&none)
    };
    let topic = |(producer, wired): (&stage::wiring::WiredStage, &stage::wiring::WiredTopic)| {
        let name = &wired.channels.topic;
        let beats = beats_of(&producer.name);
        let rate = |count: fn(&Traffic) -> u64| beats.rate(|h| h.outputs.get(name).map_or(0, count) as f64);
        let consumers = wiring.stages.iter().filter(|stage| stage.inputs.contains(name)).map(|stage| {
            let arrivals = beats_of(&stage.name).last.as_ref().and_then(|health| health.arrivals.get(name));
            ConsumerFigures {
                stage: stage.name.clone(),
                queue: arrivals.map(|arrivals| arrivals.queue),
                latency: arrivals.map(|arrivals| arrivals.latency),
            }
        });
        TopicFigures {
            topic: name.clone(),
            producer: producer.name.clone(),
            version: wired.table.version,
            header_bytes: wired.table.header_bytes,
            row_bytes: wired.table.row_bytes,
            max_rows: wired.table.max_rows,
            queue_bound: wired.messages().queue,
            published: beats.last.as_ref().and_then(|health| health.outputs.get(name).cloned()),
            messages_per_s: rate(|traffic| traffic.messages),
            rows_per_s: rate(|traffic| traffic.rows),
            bytes_per_s: rate(|traffic| traffic.bytes),
            waiting: beats.last.as_ref().and_then(|health| health.waiting.get(name).copied()),
            consumers: consumers.collect(),
        }
    };
    wiring.topics().map(topic).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beat(beat_nanos: u64, ticks: u64, cpu_s: f64) -> Health {
        Health { beat_nanos, ticks, cpu_s, drive_time: Some(ticks as i64 * 100_000_000), ..Health::default() }
    }

    #[test]
    fn rates_are_over_the_time_between_two_beats() {
        let beats = Beats { base: Some(beat(1_000_000_000, 40, 1.0)), last: Some(beat(3_000_000_000, 60, 2.0)) };
        let figures = StageFigures::new("relay", &beats, Some(6_500_000_000));
        assert_eq!(figures.ticks_per_s, Some(10.0));
        assert_eq!(figures.cpu_percent, Some(50.0));
        assert_eq!(figures.lag_s, Some(0.5));
        let one = StageFigures::new("relay", &Beats { base: None, ..beats.clone() }, None);
        assert_eq!((one.ticks, one.ticks_per_s), (Some(60), None));
        let set_back = Beats { base: beats.last, last: Some(beat(4_000_000_000, 10, 0.1)) };
        assert_eq!(StageFigures::new("relay", &set_back, None).ticks_per_s, Some(0.0));
    }
}
