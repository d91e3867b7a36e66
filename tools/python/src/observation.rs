//! A topic of a running pipeline, observed.

use crate::memory::{Lease, Memory};
use ipc::{Attached, Domain, IpcError, Observed, Observer, ObserverMode};
use pyo3::exceptions::{PyBufferError, PyOSError};
use pyo3::prelude::*;
use run::wiring::Wiring;
use std::path::{Path, PathBuf};

/// Observes a topic in one attempt of a run. Used only by the thread that created it.
#[pyclass(unsendable)]
pub struct Observation {
    output: PathBuf,
    wiring: Wiring,
    observer: Attached<Observer>,
    held: Vec<(Lease, Observed)>,
}

/// Seq, stamp, tick, header, rows.
type ObservedMessage = (u64, i64, u64, Memory, Memory);

#[pymethods]
impl Observation {
    /// Attaches to the run into `output`.
    #[new]
    #[allow(clippy::needless_pass_by_value, reason = "Python has no paths to borrow")]
    fn open(output: PathBuf, topic: &str, lossless: bool) -> PyResult<Self> {
        let output = output.canonicalize().map_err(|error| failed(&output, error))?;
        let wiring = Wiring::read(&output).map_err(|error| PyOSError::new_err(error.to_string()))?;
        if !wiring.is_alive(&output) {
            return Err(failed(&output, "the run is not alive"));
        }
        let channels = &wiring.topic(topic).map_err(|error| failed(&output, error))?.channels;
        let mode = if lossless { ObserverMode::Lossless } else { ObserverMode::Dropping };
        let domain = Domain::new(&wiring.domain).map_err(|error| failed(&output, error))?;
        let observer = domain.attach("observer", |node| Observer::open(node, &channels.messages, mode));
        let observer = observer.map_err(|error| failed(&output, error))?;
        Ok(Self { output, wiring, observer, held: Vec::new() })
    }

    /// Number of the attempt of the run: each restart starts a new attempt.
    fn attempt(&self) -> u32 {
        self.wiring.attempt
    }

    /// Whether the attempt has ended. Call it before `receive`, which then still returns messages published before the end.
    fn has_ended(&self) -> bool {
        !self.observer.is_current() || !self.wiring.is_alive(&self.output)
    }

    /// The layout of the topic's messages as JSON.
    fn table(&self, topic: &str) -> PyResult<String> {
        let table = self.wiring.topic(topic).map(|topic| serde_json::to_string(&topic.table));
        table.map_err(|error| failed(&self.output, error))?.map_err(|error| failed(&self.output, error))
    }

    /// The next message, if there is one.
    fn receive(&mut self) -> PyResult<Option<ObservedMessage>> {
        self.held.retain(|(lease, _)| lease.is_used());
        let channel = self.observer.channel();
        if self.held.len() > channel.borrowed {
            return Err(PyBufferError::new_err(format!(
                "{}: arrays of {} messages are kept, at most {} are allowed; keep copies, as in message[\"x\"].copy()",
                channel.name,
                self.held.len(),
                channel.borrowed
            )));
        }
        let received = self.observer.receive();
        let Some(message) = received.map_err(|error: IpcError| failed(&self.output, error))? else { return Ok(None) };
        let lease = Lease::default();
        let envelope = *message.envelope();
        let header = lease.read(message.header());
        let rows = lease.read(message.rows());
        self.held.push((lease, message));
        Ok(Some((envelope.seq, envelope.stamp, envelope.tick, header, rows)))
    }
}

impl Drop for Observation {
    fn drop(&mut self) {
        // Arrays may outlive their observer; their memory is then given back with the process.
        self.held.drain(..).filter(|(lease, _)| lease.is_used()).for_each(std::mem::forget);
    }
}

fn failed(output: &Path, error: impl std::fmt::Display) -> PyErr {
    PyOSError::new_err(format!("{}: {error}", output.display()))
}
