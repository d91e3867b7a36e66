//! `--metrics FILE`: the run's figures in Prometheus' text exposition format, for a node exporter's textfile collector.

mod page;

use files::atomic_file::AtomicFile;
use page::Page;
use run::health::Health;
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval of writing. Collectors read every few seconds at most.
const WRITE_EVERY: Duration = Duration::from_secs(1);

/// The first file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("--metrics {file}: cannot be written: {source}")]
pub struct MetricsError {
    file: PathBuf,
    source: std::io::Error,
}

/// Writes the file, about once a second and at the end.
pub struct Metrics {
    file: Option<PathBuf>,
    written: Option<Instant>,
    has_failed: bool,
    stages: BTreeMap<String, Totals>,
}

/// Totals that only rise over the whole run, although a restart sets a stage back to its last barrier: repeated work counts
/// once.
#[derive(Default)]
struct Totals {
    ticks: u64,
    points: u64,
    /// Messages and bytes by topic.
    published: BTreeMap<String, Published>,
    /// CPU time of the processes before this one, s.
    cpu_before_s: f64,
    /// CPU time of this process at its last beat, s.
    cpu_s: f64,
}

/// What a stage has published on a topic.
#[derive(Clone, Copy, Default)]
struct Published {
    messages: u64,
    /// Bytes of rows.
    bytes: u64,
}

impl Totals {
    fn add(&mut self, health: &Health) {
        self.ticks = self.ticks.max(health.ticks);
        self.points = self.points.max(health.points);
        for (topic, traffic) in &health.outputs {
            let published = self.published.entry(topic.clone()).or_default();
            published.messages = published.messages.max(traffic.messages);
            published.bytes = published.bytes.max(traffic.bytes);
        }
        // The CPU time of a process only rises: a lower one belongs to a new process.
        if health.usage.cpu_s < self.cpu_s {
            self.cpu_before_s += self.cpu_s;
        }
        self.cpu_s = health.usage.cpu_s;
    }
}

/// The last heartbeat of a stage.
#[derive(Clone, Copy)]
pub struct StageHealth<'a> {
    /// Name of the stage.
    pub stage: &'a str,
    /// Its heartbeat.
    pub health: &'a Health,
}

impl Metrics {
    /// Writes a first file, so that an unwritable path is reported before anything starts.
    pub fn new(file: Option<&Path>) -> Result<Self, MetricsError> {
        if let Some(file) = file {
            write(file, "").map_err(|source| MetricsError { file: file.to_owned(), source })?;
        }
        Ok(Self { file: file.map(Path::to_owned), written: None, has_failed: false, stages: BTreeMap::new() })
    }

    /// Writes the file if the interval has passed.
    pub fn update<'a>(
        &mut self,
        stages: impl Iterator<Item = StageHealth<'a>>,
        shared_memory_bytes: impl Fn() -> u64,
        restarts: u32,
    ) {
        if self.file.is_some() && self.written.is_none_or(|written| written.elapsed() >= WRITE_EVERY) {
            self.write(stages, shared_memory_bytes(), restarts);
        }
    }

    /// Writes the file. If it cannot be written, the first failure is logged.
    pub fn write<'a>(
        &mut self,
        stages: impl Iterator<Item = StageHealth<'a>>,
        shared_memory_bytes: u64,
        restarts: u32,
    ) {
        let Some(file) = self.file.clone() else { return };
        self.written = Some(Instant::now());
        let stages: Vec<StageHealth<'_>> = stages.collect();
        for StageHealth { stage, health } in &stages {
            self.stages.entry((*stage).to_owned()).or_default().add(health);
        }
        let text = self.text(&stages, shared_memory_bytes, restarts);
        if let Err(error) = write(&file, &text)
            && !std::mem::replace(&mut self.has_failed, true)
        {
            tracing::warn!("metrics cannot be written: {}: {error}", file.display());
        }
    }

    fn text(&self, stages: &[StageHealth<'_>], shared_memory_bytes: u64, restarts: u32) -> String {
        let newest = stages.iter().filter_map(|stage| stage.health.drive_time).max();
        let mut page = Page::default();
        page.family("replica_stage_ticks_total", "counter", "Ticks that the stage has finished.");
        self.for_each_stage(|stage, totals| page.sample("", &[("stage", stage)], totals.ticks));
        page.family("replica_stage_points_total", "counter", "Points that the stage has processed.");
        self.for_each_stage(|stage, totals| page.sample("", &[("stage", stage)], totals.points));
        page.family("replica_stage_cpu_seconds_total", "counter", "User and system time of the stage's processes.");
        self.for_each_stage(|stage, totals| page.sample("", &[("stage", stage)], totals.cpu_before_s + totals.cpu_s));
        page.family("replica_stage_resident_bytes", "gauge", "Resident memory, touched shared memory included.");
        for StageHealth { stage, health } in stages {
            page.sample("", &[("stage", stage)], health.usage.rss_bytes);
        }
        page.family(
            "replica_stage_step_seconds",
            "summary",
            "Duration of steps with input, since the process started.",
        );
        for StageHealth { stage, health } in stages {
            page.summary(&[("stage", stage)], &health.step);
        }
        page.family(
            "replica_stage_age_seconds",
            "summary",
            "Time from the start of a tick at the source to its end here.",
        );
        for StageHealth { stage, health } in stages {
            page.summary(&[("stage", stage)], &health.age);
        }
        page.family("replica_stage_lag_seconds", "gauge", "Drive time by which the stage is behind the source.");
        for StageHealth { stage, health } in stages {
            if let Some((newest, own)) = newest.zip(health.drive_time) {
                page.sample("", &[("stage", stage)], newest.saturating_sub(own) as f64 * 1e-9);
            }
        }
        page.family("replica_topic_messages_total", "counter", "Messages published.");
        self.for_each_topic(|topic, stage, Published { messages, .. }| {
            page.sample("", &[("topic", topic), ("stage", stage)], messages);
        });
        page.family("replica_topic_bytes_total", "counter", "Bytes of rows published; shared, not copied.");
        self.for_each_topic(|topic, stage, Published { bytes, .. }| {
            page.sample("", &[("topic", topic), ("stage", stage)], bytes);
        });
        page.family("replica_topic_waiting", "gauge", "Messages that the topic's slowest consumer has not taken yet.");
        for StageHealth { stage, health } in stages {
            for (topic, waiting) in &health.waiting {
                page.sample("", &[("topic", topic), ("stage", stage)], waiting);
            }
        }
        page.family("replica_topic_queue", "gauge", "Messages that a consumer has taken and that wait for its step.");
        for StageHealth { stage: consumer, health } in stages {
            for (topic, arrivals) in &health.arrivals {
                page.sample("", &[("topic", topic), ("consumer", consumer)], arrivals.queue);
            }
        }
        page.family(
            "replica_topic_latency_seconds",
            "summary",
            "Time from a message's publication to its delivery to a step.",
        );
        for StageHealth { stage: consumer, health } in stages {
            for (topic, arrivals) in &health.arrivals {
                page.summary(&[("topic", topic), ("consumer", consumer)], &arrivals.latency);
            }
        }
        page.family("replica_shared_memory_bytes", "gauge", "Shared memory that the run uses.");
        page.sample("", &[], shared_memory_bytes);
        page.family("replica_restarts_total", "counter", "Restarts of the run from its last barrier.");
        page.sample("", &[], restarts);
        page.family("replica_barrier", "gauge", "Last barrier that all stages have saved; 0 = none yet.");
        page.sample("", &[], stages.iter().map(|stage| stage.health.barrier).min().unwrap_or_default());
        page.text
    }

    fn for_each_stage(&self, mut each: impl FnMut(&str, &Totals)) {
        for (stage, totals) in &self.stages {
            each(stage, totals);
        }
    }

    fn for_each_topic(&self, mut each: impl FnMut(&str, &str, Published)) {
        self.for_each_stage(|stage, totals| {
            for (topic, published) in &totals.published {
                each(topic, stage, *published);
            }
        });
    }
}

/// Replaces the file atomically, because collectors may read at any moment. It need not reach the disk: the next one
/// follows in a second.
fn write(file: &Path, text: &str) -> std::io::Result<()> {
    let partial = AtomicFile::create(file)?;
    partial.file().write_all(text.as_bytes())?;
    partial.commit_unsynced()
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::health::{Arrivals, Latency, Traffic};
    use std::collections::BTreeSet;

    fn health(ticks: u64, cpu_s: f64) -> Health {
        let latency = Latency { count: 4, mean_ms: 2.5, p50_ms: 2.0, p99_ms: 4.0, max_ms: 4.0 };
        Health {
            ticks,
            usage: run::process::Usage { cpu_s, ..Default::default() },
            drive_time: Some(ticks as i64 * 100_000_000),
            step: latency,
            outputs: BTreeMap::from([(
                "class".to_owned(),
                Traffic { messages: ticks, rows: 9, bytes: 18, ..Traffic::default() },
            )]),
            arrivals: BTreeMap::from([("sweep".to_owned(), Arrivals { queue: 3, latency })]),
            waiting: BTreeMap::from([("class".to_owned(), 2)]),
            ..Health::default()
        }
    }

    fn written(metrics: &mut Metrics, stages: &[(&str, Health)]) -> String {
        metrics.write(stages.iter().map(|(stage, health)| StageHealth { stage, health }), 4096, 1);
        assert!(!metrics.has_failed);
        std::fs::read_to_string(metrics.file.as_ref().expect("a file")).expect("written")
    }

    /// The rules of the format: names, one HELP and one TYPE before a family's samples, all samples of a family
    /// together, no sample twice, counters ending in `_total`.
    #[test]
    fn page_keeps_the_rules_of_the_format() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut metrics = Metrics::new(Some(&folder.path().join("replica.prom"))).expect("can be written");
        let text = written(&mut metrics, &[("re\"l\\ay\n", health(10, 1.0)), ("source", health(12, 1.0))]);
        assert!(text.ends_with('\n'));
        let mut families = BTreeSet::new();
        let mut samples = BTreeSet::new();
        let mut family = String::new();
        let is_name = |name: &str| name.bytes().all(|b| b.is_ascii_lowercase() || b == b'_');
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            if let Some(help) = line.strip_prefix("# HELP ") {
                family = help.split(' ').next().expect("a name").to_owned();
                assert!(is_name(&family) && families.insert(family.clone()), "{line}");
                let kind =
                    lines.next().and_then(|line| line.strip_prefix(&format!("# TYPE {family} "))).expect("a type");
                assert_eq!(kind == "counter", family.ends_with("_total"), "{family} {kind}");
                assert!(["counter", "gauge", "summary"].contains(&kind), "{kind}");
                continue;
            }
            let (sample, value) = line.rsplit_once(' ').expect("a value");
            assert!(value.parse::<f64>().is_ok_and(f64::is_finite), "{line}");
            assert!(samples.insert(sample), "twice: {line}");
            let name = sample.split('{').next().expect("a name");
            let suffix = name.strip_prefix(&family).unwrap_or_else(|| panic!("{line} is not of {family}"));
            assert!(["", "_sum", "_count"].contains(&suffix), "{line}");
        }
        assert_eq!(families.len(), 15);
        assert!(text.contains("replica_stage_ticks_total{stage=\"re\\\"l\\\\ay\\n\"} 10\n"), "{text}");
        assert!(text.contains("replica_stage_lag_seconds{stage=\"source\"} 0\n"), "{text}");
        assert!(text.contains("replica_stage_step_seconds{stage=\"source\",quantile=\"0.5\"} 0.002\n"), "{text}");
        assert!(text.contains("replica_stage_step_seconds_sum{stage=\"source\"} 0.01\n"), "{text}");
        assert!(text.contains("replica_topic_queue{topic=\"sweep\",consumer=\"source\"} 3\n"), "{text}");
    }

    #[test]
    fn totals_do_not_fall_at_a_restart() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut metrics = Metrics::new(Some(&folder.path().join("replica.prom"))).expect("can be written");
        for (ticks, cpu_s) in [(10, 2.0), (0, 0.0), (4, 0.5)] {
            let text = written(&mut metrics, &[("relay", health(ticks, cpu_s))]);
            assert!(text.contains("replica_stage_ticks_total{stage=\"relay\"} 10\n"), "{text}");
            assert!(text.contains("replica_topic_messages_total{topic=\"class\",stage=\"relay\"} 10\n"), "{text}");
            assert!(
                text.contains(&format!(
                    "cpu_seconds_total{{stage=\"relay\"}} {}\n",
                    if ticks == 10 { 2.0 } else { 2.0 + cpu_s }
                )),
                "{text}"
            );
        }
    }

    #[test]
    fn unwritable_file_is_refused_at_the_start_and_tolerated_later() {
        let folder = tempfile::tempdir().expect("a folder");
        let inside = folder.path().join("inside");
        assert!(Metrics::new(Some(&inside.join("replica.prom"))).is_err());
        std::fs::create_dir(&inside).expect("made");
        let mut metrics = Metrics::new(Some(&inside.join("replica.prom"))).expect("can be written");
        std::fs::remove_dir_all(&inside).expect("removed");
        metrics.write(std::iter::empty(), 0, 0);
        assert!(metrics.has_failed);
    }
}
