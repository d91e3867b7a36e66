//! The operator's requests to a run: signals to the supervisor, and requests of `replica stop` and `replica swap`.

use super::error::SuperviseError;
use crate::active_run::ActiveRun;
use crate::control::{ClientRequest, Control};
use crate::swap::Swaps;
use run::control::{Answer, Request};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;

/// Signals and requests.
pub struct Operator {
    /// Clients that wait for an answer.
    pub control: Control,
    signals: Signals,
    /// The first request drains the run, the second one stops it.
    n_end_requests: usize,
    /// SIGTERM was received. Later ones are not requests: schedulers repeat it, and a parent process forwards its own.
    is_terminated: bool,
}

/// Starts to receive signals.
pub fn signals() -> Result<Signals, SuperviseError> {
    Signals::new([SIGINT, SIGTERM, SIGHUP, SIGQUIT]).map_err(SuperviseError::Signals)
}

impl Operator {
    /// An operator without requests.
    pub fn new(signals: Signals, control: Control) -> Self {
        Self { control, signals, n_end_requests: 0, is_terminated: false }
    }

    /// Receives signals and requests. Never waits.
    pub fn poll(&mut self, swaps: &mut Swaps, run: &ActiveRun) {
        for signal in self.signals.pending() {
            if signal != SIGTERM || !std::mem::replace(&mut self.is_terminated, true) {
                self.n_end_requests += 1;
            }
        }
        for ClientRequest { client, request } in self.control.requests() {
            match request {
                Request::Stop { now } => {
                    self.n_end_requests = self.n_end_requests.max(if now { 2 } else { 1 });
                    self.control.working(client, if now { "stopping" } else { "draining in-flight data" });
                }
                Request::Swap(request) => match swaps.begin(client, request, run, self.is_ending()) {
                    Ok(()) => self.control.working(client, "checking"),
                    Err(reason) => self.control.answer(client, &Answer::Refused(vec![reason.to_string()])),
                },
            }
        }
    }

    /// Whether the end of the run was requested, so that the run drains.
    pub fn is_ending(&self) -> bool {
        self.n_end_requests > 0
    }

    /// Whether the run must stop without draining.
    pub fn must_stop(&self) -> bool {
        self.n_end_requests > 1
    }
}
