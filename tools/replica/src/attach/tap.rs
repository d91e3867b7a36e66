//! The messages of one topic, through restarts.

use super::{Run, channels};
use crate::terminal::StopFlag;
use ipc::{Looking, Observed, Observer, Visit};
use std::time::{Duration, Instant};

/// Onlookers have no wake of their own. A queue of four sweeps is full after 8 ms at 500 sweeps per second, and a look
/// costs some microseconds.
const LOOK: Duration = Duration::from_millis(2);

/// What comes out of a tap.
pub enum TapEvent {
    /// The next message, and how many of its topic went by unseen since the last.
    Message(Observed, u64),
    /// The run goes on from its last barrier: numbers begin there again. The attempt.
    Restarted(u32),
    /// The run has ended, or was left.
    Ended,
}

/// A place from which the messages of a topic are seen.
pub struct Tap {
    run: Run,
    topic: String,
    looking: Looking,
    visit: Visit<Observer>,
    stop: StopFlag,
    next_seq: Option<u64>,
}

impl Tap {
    /// `None` if the run ended before.
    pub fn open(mut run: Run, topic: &str, looking: Looking, stop: StopFlag) -> anyhow::Result<Option<Self>> {
        run.topic(topic)?;
        let visit = attach(&mut run, topic, looking, &stop)?;
        Ok(visit.map(|visit| Self { run, topic: topic.to_owned(), looking, visit, stop, next_seq: None }))
    }

    /// Waits for the next event, at most until `deadline`.
    pub fn next(&mut self, deadline: Option<Instant>) -> anyhow::Result<Option<TapEvent>> {
        loop {
            if self.stop.is_set() {
                return Ok(Some(TapEvent::Ended));
            }
            let over = self.run.is_over(&self.visit);
            match self.visit.receive() {
                Ok(Some(message)) => {
                    let seq = message.envelope().seq;
                    let missed = self.next_seq.map_or(0, |due| seq.saturating_sub(due));
                    self.next_seq = Some(seq + 1);
                    return Ok(Some(TapEvent::Message(message, missed)));
                }
                Err(error) => {
                    self.run.excuse(&self.visit, error)?;
                    return self.follow().map(Some);
                }
                Ok(None) if over => return self.follow().map(Some),
                Ok(None) => {}
            }
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return Ok(None);
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Goes on with the run's next attempt, if there is one.
    fn follow(&mut self) -> anyhow::Result<TapEvent> {
        let Some(visit) = attach(&mut self.run, &self.topic, self.looking, &self.stop)? else {
            return Ok(TapEvent::Ended);
        };
        self.visit = visit;
        self.next_seq = None;
        Ok(TapEvent::Restarted(self.run.wiring.attempt))
    }
}

fn attach(run: &mut Run, topic: &str, looking: Looking, stop: &StopFlag) -> anyhow::Result<Option<Visit<Observer>>> {
    run.visit(|node, wiring| Observer::open(node, &channels(wiring, topic)?.messages, looking), || stop.is_set())
}
