//! The data of a step in Python: its received messages, loans and outputs.
//!
//! All of it belongs to the thread that runs the stage. Python has addresses of it ([`Memory`](crate::memory::Memory)); nothing is
//! dropped while an object of Python refers to it.

use crate::memory::{Lease, Memory};
use pyo3::exceptions::{PyBufferError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use stage::untyped::{UntypedLoan, UntypedMessage};
use stage::{Inputs, Outputs, Port, StepError};
use std::cell::RefCell;
use std::collections::BTreeMap;

thread_local! {
    static SESSION: RefCell<Session> = RefCell::default();
}

#[derive(Default)]
struct Session {
    /// The outputs, only during a call of the stage.
    outputs: Option<Outputs>,
    output_ports: Vec<Port>,
    loans: BTreeMap<u64, Loaned>,
    next_loan: u64,
    held: Vec<Held>,
    /// Why an output failed: the error that ends the stage, whatever Python made of it.
    error: Option<StepError>,
}

struct Loaned {
    lease: Lease,
    loan: Box<dyn UntypedLoan>,
}

struct Held {
    lease: Lease,
    topic: &'static str,
    message: Box<dyn UntypedMessage>,
}

/// A received message for Python: topic, seq, stamp, tick, header, rows.
pub type ReceivedMessage = (&'static str, u64, i64, u64, Memory, Memory);

/// Starts the stage with these outputs.
pub fn begin(output_ports: Vec<Port>) {
    with(|session| session.output_ports = output_ports);
}

/// Calls Python with the outputs at hand. An error of an output takes precedence over the exception that it caused.
pub fn call<R>(outputs: &mut Outputs, python: impl FnOnce() -> Result<R, StepError>) -> Result<R, StepError> {
    with(|session| session.outputs = Some(std::mem::take(outputs)));
    let result = python();
    with(|session| {
        *outputs = session.outputs.take().unwrap_or_default();
        // A loan that Python has dropped without publishing it.
        session.loans.retain(|_, loaned| loaned.lease.is_used());
        session.error.take()
    })
    .map_or(result, Err)
}

/// Hands the messages of a tick to Python, which may keep them.
pub fn receive(inputs: &mut Inputs, ports: &[Port]) -> Vec<ReceivedMessage> {
    let mut received = Vec::new();
    for port in ports {
        for message in inputs.take_untyped(port) {
            let lease = Lease::default();
            let envelope = message.envelope();
            let seq = envelope.seq;
            let stamp = envelope.stamp;
            let tick = envelope.tick;
            let header = lease.read(message.header());
            let rows = lease.read(message.rows());
            received.push((port.topic(), seq, stamp, tick, header, rows));
            with(|session| session.held.push(Held { lease, topic: port.topic(), message }));
        }
    }
    received
}

/// Gives back messages that Python no longer refers to. Returns the numbers of the messages of `topic` that it still refers to.
pub fn still_held(topic: &str) -> Vec<u64> {
    with(|session| {
        session.held.retain(|held| held.lease.is_used());
        let of_topic = session.held.iter().filter(|held| held.topic == topic);
        of_topic.map(|held| held.message.envelope().seq).collect()
    })
}

/// Ends the session. Memory that Python still refers to is never given back; the process ends soon.
pub fn end() {
    with(|session| {
        let held = std::mem::take(&mut session.held);
        let loans = std::mem::take(&mut session.loans);
        held.into_iter().filter(|held| held.lease.is_used()).for_each(std::mem::forget);
        loans.into_values().filter(|loaned| loaned.lease.is_used()).for_each(std::mem::forget);
    });
}

/// A loan of `n_rows` zeroed rows: its number, header, rows.
#[pyfunction]
pub fn loan(topic: &str, n_rows: usize) -> PyResult<(u64, Memory, Memory)> {
    with_outputs(|session, outputs| {
        session.loans.retain(|_, loaned| loaned.lease.is_used());
        let port = session.output_ports.iter().find(|port| port.topic() == topic);
        let port = port.ok_or_else(|| PyValueError::new_err(format!("{topic} is not among the stage's outputs")))?;
        let mut loan = outputs.loan_untyped(port, n_rows).map_err(|error| session.failed(error))?;
        let lease = Lease::default();
        let header = lease.write(loan.header_mut());
        let rows = lease.write(loan.rows_mut());
        let number = session.next_loan;
        session.next_loan += 1;
        session.loans.insert(number, Loaned { lease, loan });
        Ok((number, header, rows))
    })
}

/// Publishes a loan that no array refers to. Waits while a consumer's queue is full, without the interpreter's lock.
#[pyfunction]
pub fn publish(py: Python<'_>, number: u64, topic: &str, stamp: i64, column: Option<u64>) -> PyResult<()> {
    py.detach(|| {
        with_outputs(|session, outputs| {
            let Some(loaned) = session.loans.remove(&number) else {
                return Err(PyRuntimeError::new_err(format!("{topic}: the loan is published already")));
            };
            if loaned.lease.is_used() {
                session.loans.insert(number, loaned);
                return Err(PyBufferError::new_err(format!(
                    "{topic}: an array still refers to the loan: `del` it before publish, or write through the loan \
                     itself, as in loan[\"field\"][:] = values"
                )));
            }
            loaned.loan.publish(outputs, stamp, column).map_err(|error| session.failed(error))
        })
    })
}

/// See `Outputs::count`.
#[pyfunction]
pub fn count(name: &str, n: u64) -> PyResult<()> {
    with_outputs(|_, outputs| {
        outputs.count(name, n);
        Ok(())
    })
}

/// See `Outputs::note`.
#[pyfunction]
pub fn note(text: String) -> PyResult<()> {
    with_outputs(|_, outputs| {
        outputs.note(text);
        Ok(())
    })
}

/// See `Outputs::doubt`; without a text, see `Outputs::withdraw_doubt`.
#[pyfunction]
pub fn doubt(name: &str, size: f64, text: Option<String>) -> PyResult<()> {
    with_outputs(|_, outputs| {
        match text {
            Some(text) => outputs.doubt(name, size, text),
            None => outputs.withdraw_doubt(name),
        }
        Ok(())
    })
}

/// See `Outputs::mark_progress`.
#[pyfunction]
pub fn mark_progress() -> PyResult<()> {
    with_outputs(|_, outputs| {
        outputs.mark_progress();
        Ok(())
    })
}

/// Sources: see `Outputs::set_drive_time` and `Outputs::set_progress`.
#[pyfunction]
pub fn set_drive_time(stamp: i64, progress: f64) -> PyResult<()> {
    with_outputs(|_, outputs| {
        outputs.set_drive_time(stamp);
        outputs.set_progress(progress);
        Ok(())
    })
}

impl Session {
    /// Keeps the error that ends the stage, and makes an exception of it.
    fn failed(&mut self, error: StepError) -> PyErr {
        let exception = PyRuntimeError::new_err(error.to_string());
        self.error.get_or_insert(error);
        exception
    }
}

fn with<R>(use_it: impl FnOnce(&mut Session) -> R) -> R {
    SESSION.with_borrow_mut(use_it)
}

fn with_outputs<R>(use_them: impl FnOnce(&mut Session, &mut Outputs) -> PyResult<R>) -> PyResult<R> {
    with(|session| {
        let outputs = session.outputs.take();
        let mut outputs = outputs.ok_or_else(|| {
            PyRuntimeError::new_err("outputs can be used only within step and finish, by the thread that calls them")
        })?;
        let result = use_them(session, &mut outputs);
        session.outputs = Some(outputs);
        result
    })
}
