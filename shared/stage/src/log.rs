//! The log of a stage's process on stderr: `tracing` events as lines for people or as JSON.

use run::LOG_FORMAT;
use std::backtrace::{Backtrace, BacktraceStatus};
use tracing_subscriber::EnvFilter;

/// Logs what `REPLICA_LOG` selects (`info` without) in the format of [`LOG_FORMAT`], and panics, too.
pub(crate) fn start() {
    // A full disk cannot store the log, and cannot store an error about it: it must not end the stage.
    let log = tracing_subscriber::fmt()
        .log_internal_errors(false)
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .with_env_filter(EnvFilter::try_from_env("REPLICA_LOG").unwrap_or_else(|_| EnvFilter::new("info")));
    if std::env::var(LOG_FORMAT).is_ok_and(|format| format == "json") {
        log.json().flatten_event(true).init();
    } else {
        log.init();
    }
    log_panics();
}

/// The message of a panic is the last line; the backtrace, if `RUST_BACKTRACE` asks for one, comes before it.
fn log_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let backtrace = Backtrace::capture();
        if backtrace.status() == BacktraceStatus::Captured {
            tracing::error!("{backtrace}");
        }
        tracing::error!("{}", panic.to_string().replace('\n', " "));
    }));
}
