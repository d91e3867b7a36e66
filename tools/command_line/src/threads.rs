//! The bound of the number of threads ([`run::threads`]) for the tools; stages get theirs from the supervisor.

use crate::say_error;

/// Replaces a number of threads of the environment that is too large. Call it before the first parallel loop.
pub fn bound() {
    let Some(n_threads) = run::threads::bounded_environment() else { return };
    say_error!("warning: RAYON_NUM_THREADS is too large for this machine; {n_threads} threads are used");
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build_global() {
        say_error!("warning: {n_threads} threads cannot be started: {error}");
    }
}
