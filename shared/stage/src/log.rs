//! The log of a stage's process on stderr: `tracing` events as lines for people or as JSON.

use run::LOG_FORMAT;
use std::backtrace::{Backtrace, BacktraceStatus};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

thread_local! {
    /// Whether a panic of this thread is caught, and reported by the caller of [`catch_panic`].
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// The result of `call`, or the message of its panic, which is not logged. For libraries that panic on damaged files: the caller
/// reports the file. `call` must not start threads, whose panics would be logged.
pub fn catch_panic<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    let before = IS_CAUGHT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(call));
    IS_CAUGHT.set(before);
    result.map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic without a text".to_owned())
    })
}

/// Environment variable that selects what is logged: a level, or levels by target (`info,stage=debug`).
const LOG: &str = "REPLICA_LOG";

/// The targets that a text of [`LOG`] selects; `info` without a text or with an unreadable text.
fn selected(text: Option<&str>) -> Targets {
    let selected = text.filter(|text| !text.trim().is_empty()).and_then(|text| text.parse().ok());
    selected.unwrap_or_else(|| Targets::new().with_default(LevelFilter::INFO))
}

/// Logs the events that [`LOG`] selects in the format of [`LOG_FORMAT`], and panics.
pub(crate) fn start() {
    // A full disk can store neither the log nor an error about it. This must not end the stage.
    let lines =
        tracing_subscriber::fmt::layer().log_internal_errors(false).with_writer(std::io::stderr).with_ansi(false);
    let selected = tracing_subscriber::registry().with(selected(std::env::var(LOG).ok().as_deref()));
    if std::env::var(LOG_FORMAT).is_ok_and(|format| format == "json") {
        selected.with(lines.json().flatten_event(true)).init();
    } else {
        selected.with(lines).init();
    }
    log_panics();
}

/// Logs panics. The message is the last line; the backtrace, if `RUST_BACKTRACE` requests one, precedes it.
fn log_panics() {
    std::panic::set_hook(Box::new(|panic| {
        if IS_CAUGHT.get() {
            tracing::debug!("caught: {panic}");
            return;
        }
        let backtrace = Backtrace::capture();
        if backtrace.status() == BacktraceStatus::Captured {
            tracing::error!("{backtrace}");
        }
        tracing::error!("{}", panic.to_string().replace('\n', " "));
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing::Level;

    #[test]
    fn level_is_selected_for_all_targets_or_by_target() {
        let logs = |text: Option<&str>, target: &str, level: Level| selected(text).would_enable(target, &level);
        assert!(logs(None, "stage", Level::INFO) && !logs(None, "stage", Level::DEBUG));
        assert!(logs(Some("debug"), "infer", Level::DEBUG) && !logs(Some("debug"), "infer", Level::TRACE));
        let by_target = Some("warn,stage=debug");
        assert!(logs(by_target, "stage::runner", Level::DEBUG) && !logs(by_target, "infer", Level::INFO));
        for unreadable in ["", "infer=loud"] {
            assert!(logs(Some(unreadable), "infer", Level::INFO), "{unreadable:?}");
        }
    }

    #[test]
    fn caught_panic_gives_its_message_and_the_next_one_is_logged_again() {
        assert_eq!(catch_panic(|| 7), Ok(7));
        assert_eq!(catch_panic(|| -> u8 { panic!("byte {} is invalid", 3) }), Err("byte 3 is invalid".to_owned()));
        assert_eq!(catch_panic(|| catch_panic(|| -> u8 { panic!("inner") })), Ok(Err("inner".to_owned())));
        assert!(!IS_CAUGHT.get());
    }
}
