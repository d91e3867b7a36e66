//! Receives the messages of one topic, across restarts of the run.

use super::run_handle::Run;
use command_line::terminal::StopFlag;
use ipc::{Attached, Observed, Observer, ObserverMode};
use run::observed_run::channels;
use std::time::{Duration, Instant};

/// Observers are not notified, so they poll. A queue of four sweeps is full after 8 ms at 500 sweeps per second, and a poll
/// costs some microseconds.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// An event of a topic.
pub enum TopicEvent {
    /// The next message, and how many messages of the topic were missed before it.
    Message(Observed, u64),
    /// The run restarted from its last barrier, and sequence numbers continue from there. The number of the attempt.
    Restarted(u32),
    /// The run has ended, or the stop flag is set.
    Ended,
}

/// Receives the messages of one topic.
pub struct TopicReader {
    run: Run,
    topic: String,
    mode: ObserverMode,
    attached: Attached<Observer>,
    stop: StopFlag,
    next_seq: Option<u64>,
}

impl TopicReader {
    /// Attaches to the topic. `None` if the run has already ended.
    pub fn open(mut run: Run, topic: &str, mode: ObserverMode, stop: StopFlag) -> anyhow::Result<Option<Self>> {
        run.topic(topic)?;
        let attached = attach(&mut run, topic, mode, &stop)?;
        Ok(attached.map(|attached| Self { run, topic: topic.to_owned(), mode, attached, stop, next_seq: None }))
    }

    /// Waits for the next event, at most until `deadline`.
    pub fn next(&mut self, deadline: Option<Instant>) -> anyhow::Result<Option<TopicEvent>> {
        loop {
            if self.stop.is_set() {
                return Ok(Some(TopicEvent::Ended));
            }
            let has_ended = self.run.has_ended(&self.attached);
            match self.attached.receive() {
                Ok(Some(message)) => {
                    let seq = message.envelope().seq;
                    let missed = self.next_seq.map_or(0, |due| seq.saturating_sub(due));
                    self.next_seq = Some(seq + 1);
                    return Ok(Some(TopicEvent::Message(message, missed)));
                }
                Err(error) => {
                    self.run.ignore_if_ended(&self.attached, error)?;
                    return self.attach_again().map(Some);
                }
                Ok(None) if has_ended => return self.attach_again().map(Some),
                Ok(None) => {}
            }
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                return Ok(None);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Attaches to the run's next attempt, if there is one.
    fn attach_again(&mut self) -> anyhow::Result<TopicEvent> {
        let Some(attached) = attach(&mut self.run, &self.topic, self.mode, &self.stop)? else {
            return Ok(TopicEvent::Ended);
        };
        self.attached = attached;
        self.next_seq = None;
        Ok(TopicEvent::Restarted(self.run.wiring.attempt))
    }
}

fn attach(
    run: &mut Run,
    topic: &str,
    mode: ObserverMode,
    stop: &StopFlag,
) -> anyhow::Result<Option<Attached<Observer>>> {
    let open = |node: &_, wiring: &_| Observer::open(node, &channels(wiring, topic)?.messages, mode);
    Ok(run.attach(open, || stop.is_set())?)
}
