//! A thread that renews a lease: also while the supervisor waits for the simulation of a drive or for the report.

use super::{Lease, Lost, RENEW_EVERY};
use run::process::boottime_nanos;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A lease that is renewed until it is dropped, which releases it.
#[derive(Debug)]
pub struct HeldLease {
    state: Arc<State>,
    /// Dropped to end the thread.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct State {
    /// End of the time in which the run may write, on the clock of [`boottime_nanos`].
    valid_until_nanos: AtomicU64,
    lost: Mutex<Option<Lost>>,
}

impl HeldLease {
    /// Starts to renew.
    pub fn new(lease: Lease) -> Result<Self, std::io::Error> {
        let state =
            Arc::new(State { valid_until_nanos: AtomicU64::new(nanos(lease.valid_until())), lost: Mutex::new(None) });
        let (end, ended) = channel();
        let shared = Arc::clone(&state);
        let renew = move || {
            let mut lease = lease;
            while ended.recv_timeout(RENEW_EVERY) == Err(RecvTimeoutError::Timeout) {
                match lease.renew(now()) {
                    Ok(Ok(())) => shared.valid_until_nanos.store(nanos(lease.valid_until()), Ordering::Relaxed),
                    Ok(Err(lost)) => {
                        shared.valid_until_nanos.store(0, Ordering::Relaxed);
                        *shared.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(lost);
                        return;
                    }
                    Err(error) => tracing::warn!("the lease of the output cannot be renewed: {error}; trying again"),
                }
            }
            if let Err(error) = lease.release() {
                tracing::warn!("the lease of the output cannot be released: {error}; it expires by itself");
            }
        };
        let thread = std::thread::Builder::new().name("lease".to_owned()).spawn(renew)?;
        Ok(Self { state, end: Some(end), thread: Some(thread) })
    }

    /// The end of the time in which stages may begin a step, on the clock of [`boottime_nanos`].
    pub fn valid_until_nanos(&self) -> u64 {
        self.state.valid_until_nanos.load(Ordering::Relaxed)
    }

    /// The file of the run that took the lease over, once.
    pub fn take_lost(&self) -> Option<Lost> {
        self.state.lost.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Drop for HeldLease {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread leaves a lease that expires.
            let _ = thread.join();
        }
    }
}

/// The clock of leases.
pub fn now() -> Duration {
    Duration::from_nanos(boottime_nanos())
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
