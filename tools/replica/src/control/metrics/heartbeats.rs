//! Receives the heartbeats of the stages of a run.

use super::heartbeat_pair::HeartbeatPair;
use crate::control::attach::Run;
use ipc::{Attached, LatestSubscriber};
use run::health::{HEARTBEAT, Health};
use std::time::{Duration, Instant};

/// Interval between two polls: a tenth of the time between two heartbeats.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// A stage without ten consecutive heartbeats hangs or has ended. It is then shown without metrics.
const TIMEOUT: Duration = Duration::from_secs(2);

/// The heartbeats of all stages, in the order of the wiring.
pub struct Heartbeats {
    attached: Attached<Vec<LatestSubscriber>>,
    heartbeats: Vec<HeartbeatPair>,
}

impl Heartbeats {
    /// Subscribes to the heartbeats. `None` if the run has ended or `stop` returns true.
    pub fn attach(run: &mut Run, stop: impl Fn() -> bool) -> anyhow::Result<Option<Self>> {
        let attached = run.attach(
            |node, wiring| {
                let names = wiring.stages.iter().map(|stage| format!("{}.health", stage.name));
                names.map(|name| LatestSubscriber::open(node, &name)).collect()
            },
            stop,
        )?;
        Ok(attached.map(|attached: Attached<Vec<_>>| Self {
            heartbeats: vec![HeartbeatPair::default(); attached.len()],
            attached,
        }))
    }

    /// Receives until every stage has two heartbeats that are `interval` apart, or the timeout passes. `false` if the attempt has
    /// ended or `stop` returns true.
    pub fn receive(&mut self, interval: Duration, stop: impl Fn() -> bool) -> anyhow::Result<bool> {
        for beats in &mut self.heartbeats {
            beats.base = beats.last.take();
        }
        let least_seconds = interval.saturating_sub(HEARTBEAT / 2).as_secs_f64();
        let deadline = Instant::now() + interval + TIMEOUT;
        while !stop() {
            for (subscriber, beats) in self.attached.iter().zip(&mut self.heartbeats) {
                let beat = subscriber.poll()?.and_then(|bytes| serde_json::from_slice::<Health>(&bytes).ok());
                if let Some(beat) = beat {
                    beats.base.get_or_insert_with(|| beat.clone());
                    beats.last = Some(beat);
                }
            }
            if !self.attached.is_current() {
                return Ok(false);
            }
            let is_complete = |beats: &HeartbeatPair| beats.seconds().is_some_and(|seconds| seconds >= least_seconds);
            if self.heartbeats.iter().all(is_complete) || Instant::now() >= deadline {
                return Ok(true);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        Ok(false)
    }

    /// The latest pair of each stage.
    pub fn pairs(&self) -> &[HeartbeatPair] {
        &self.heartbeats
    }
}
