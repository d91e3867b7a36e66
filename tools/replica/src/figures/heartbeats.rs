//! Listening to the heartbeats of a run.

use super::Beats;
use crate::attach::Run;
use ipc::{LatestSubscriber, Visit};
use stage::health::{HEARTBEAT, Health};
use std::time::{Duration, Instant};

/// Between two looks: a tenth of the time between two beats.
const LOOK: Duration = Duration::from_millis(20);
/// A stage that has not beaten for ten beats hangs or has ended; it is shown as silent.
const PATIENCE: Duration = Duration::from_secs(2);

/// The beats of all stages, in the order of the wiring.
pub struct Heartbeats {
    visit: Visit<Vec<LatestSubscriber>>,
    beats: Vec<Beats>,
}

impl Heartbeats {
    /// Begins to listen. `None` if the run has ended, or if `stop` says so.
    pub fn attach(run: &mut Run, stop: impl Fn() -> bool) -> anyhow::Result<Option<Self>> {
        let visit = run.visit(
            |node, wiring| {
                let names = wiring.stages.iter().map(|stage| format!("{}.health", stage.name));
                names.map(|name| LatestSubscriber::open(node, &name)).collect()
            },
            stop,
        )?;
        Ok(visit.map(|visit: Visit<Vec<_>>| Self { beats: vec![Beats::default(); visit.len()], visit }))
    }

    /// Listens until every stage that beats has two beats that are `interval` apart. `false` if the attempt is over
    /// or `stop` says so.
    pub fn listen(&mut self, interval: Duration, stop: impl Fn() -> bool) -> anyhow::Result<bool> {
        for beats in &mut self.beats {
            beats.base = beats.last.take();
        }
        let enough = interval.saturating_sub(HEARTBEAT / 2).as_secs_f64();
        let deadline = Instant::now() + interval + PATIENCE;
        while !stop() {
            for (subscriber, beats) in self.visit.iter().zip(&mut self.beats) {
                let beat = subscriber.poll()?.and_then(|bytes| serde_json::from_slice::<Health>(&bytes).ok());
                if let Some(beat) = beat {
                    beats.base.get_or_insert_with(|| beat.clone());
                    beats.last = Some(beat);
                }
            }
            if !self.visit.is_current() {
                return Ok(false);
            }
            let is_enough = |beats: &Beats| beats.seconds().is_some_and(|seconds| seconds >= enough);
            if self.beats.iter().all(is_enough) || Instant::now() >= deadline {
                return Ok(true);
            }
            std::thread::sleep(LOOK);
        }
        Ok(false)
    }

    /// What has been heard.
    pub fn beats(&self) -> &[Beats] {
        &self.beats
    }
}
