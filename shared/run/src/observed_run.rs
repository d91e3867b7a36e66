//! A run from an observer's point of view: its services in shared memory, from attempt to attempt.

use crate::assignment::TopicChannels;
use crate::wiring::{WiredTopic, Wiring, WiringError};
use ipc::{Attached, Domain, IpcError, Node};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval between two checks of a state that may have changed.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// The slot of an observer that died is free again after a second, and an attempt opens all its services a moment after
/// the first one. A run that refuses an observer for longer has no free slot.
const ATTACH_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval between checks of the supervisor. A killed supervisor leaves its domain behind, so its process is checked
/// as well.
const SUPERVISOR_CHECK_INTERVAL: Duration = Duration::from_millis(500);
/// Operations on a domain that is being removed fail before the domain has disappeared. An error that lasts longer has
/// another cause.
const REMOVAL_TIMEOUT: Duration = Duration::from_secs(5);

/// A run that cannot be observed.
#[derive(Debug, thiserror::Error)]
pub enum ObserveError {
    /// There is no run, or its description cannot be read.
    #[error(transparent)]
    Wiring(#[from] WiringError),
    /// The output folder.
    #[error("{}: {cause}", output.display())]
    Output {
        /// The folder.
        output: PathBuf,
        /// Reason why it cannot be used.
        cause: std::io::Error,
    },
    /// The run exists, but refuses another observer.
    #[error(
        "no free observer slot: a topic has three, one of them lossless\nhint: end another observer of the topic: {0}"
    )]
    NoSlot(IpcError),
    /// Shared memory.
    #[error(transparent)]
    Ipc(#[from] IpcError),
}

/// A run, as its supervisor describes it.
pub struct ObservedRun {
    /// Its output folder, absolute.
    pub output: PathBuf,
    /// Its latest wiring.
    pub wiring: Wiring,
    /// The attempt that was attached to last. Everything opened in it is closed before the next attempt.
    attached_attempt: Option<u32>,
    supervisor_checked: Instant,
}

impl ObservedRun {
    /// The run into a folder, alive or ended.
    pub fn read(output: &Path) -> Result<Self, ObserveError> {
        let wiring = Wiring::read(output)?;
        let output =
            output.canonicalize().map_err(|cause| ObserveError::Output { output: output.to_owned(), cause })?;
        Ok(Self { output, wiring, attached_attempt: None, supervisor_checked: Instant::now() })
    }

    /// Whether the supervisor that wrote the wiring is running.
    pub fn is_alive(&self) -> bool {
        self.wiring.is_alive(&self.output)
    }

    /// The topic called `name`.
    pub fn topic(&self, name: &str) -> Result<&WiredTopic, WiringError> {
        self.wiring.topic(name)
    }

    /// The run's services in shared memory.
    pub fn domain(&self) -> Result<Domain, IpcError> {
        Domain::new(&self.wiring.domain)
    }

    /// Waits for the next attempt of the run and opens services in it with `open`. Between two attempts a run has no services.
    /// `None` if the run has ended or `stop` returns true.
    pub fn attach<T>(
        &mut self,
        open: impl Fn(&Node, &Wiring) -> Result<T, IpcError>,
        stop: impl Fn() -> bool,
    ) -> Result<Option<Attached<T>>, ObserveError> {
        let mut refused_since = None;
        while self.is_alive() && !stop() {
            self.wiring = Wiring::read(&self.output)?;
            if self.attached_attempt == Some(self.wiring.attempt) {
                std::thread::sleep(POLL_INTERVAL);
                continue;
            }
            let domain = self.domain()?;
            match domain.attach("observer", |node| open(node, &self.wiring)) {
                // The supervisor announces an attempt before it creates the services of the attempt. The services that were
                // opened belong to this attempt only if the wiring is still the same.
                Ok(attached) if Wiring::read(&self.output).is_ok_and(|wiring| wiring == self.wiring) => {
                    self.attached_attempt = Some(self.wiring.attempt);
                    return Ok(Some(attached));
                }
                Err(_) if !domain.root().exists() => refused_since = None,
                Err(error) if refused_since.get_or_insert_with(Instant::now).elapsed() > ATTACH_TIMEOUT => {
                    return Err(ObserveError::NoSlot(error));
                }
                _ => {}
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        Ok(None)
    }

    /// Whether the attempt of `attached` has ended. Call this before receiving: a message that was published before the end is
    /// then received before the end is noticed.
    pub fn has_ended<T>(&mut self, attached: &Attached<T>) -> bool {
        if !attached.is_current() {
            return true;
        }
        if self.supervisor_checked.elapsed() < SUPERVISOR_CHECK_INTERVAL {
            return false;
        }
        self.supervisor_checked = Instant::now();
        !self.is_alive()
    }

    /// Waits for the attempt to end and drops `error`, which its end caused. Returns the error if the attempt
    /// continues.
    pub fn ignore_if_ended<T>(&self, attached: &Attached<T>, error: IpcError) -> Result<(), IpcError> {
        let begun = Instant::now();
        while attached.is_current() && self.is_alive() {
            if begun.elapsed() > REMOVAL_TIMEOUT {
                return Err(error);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }
}

/// The channels of a topic, for use in `open` of [`ObservedRun::attach`].
pub fn channels<'a>(wiring: &'a Wiring, topic: &str) -> Result<&'a TopicChannels, IpcError> {
    let wired = wiring
        .topic(topic)
        .map_err(|cause| IpcError::Transport { what: "wiring".to_owned(), cause: cause.to_string() })?;
    Ok(&wired.channels)
}
