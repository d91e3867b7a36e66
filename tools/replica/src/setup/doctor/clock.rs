//! The clocks of the machine. Recorded drives do not depend on them; a live run stamps the data of sensors without a clock.

use super::check::{Check, State};
use files::calendar::date_from_days;
use run::process::monotonic_nanos;
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// 2025-01-01, s since the Unix epoch: an earlier time means that the machine's clock has no battery.
const EARLIEST_S: u64 = 1_735_689_600;
/// Time over which both clocks are compared.
const SPAN: Duration = Duration::from_millis(100);
/// A corrected clock runs at most 500 ppm fast or slow; the rest is the time between two readings on a busy machine.
const MAX_DIFFERENCE: Duration = Duration::from_millis(20);

/// The checks.
pub fn checks() -> [Check; 3] {
    [time(), steadiness(), synchronization()]
}

fn time() -> Check {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let state = if seconds < EARLIEST_S { State::Problem } else { State::Ok };
    let (year, month, day) = date_from_days((seconds / 86_400) as i64);
    Check::ok("clock", format!("{year:04}-{month:02}-{day:02} (UTC)"), "2025 or later")
        .or(state, || "set the clock: date --set, or a time server".to_owned())
}

/// Whether the wall clock advances as fast as the monotonic clock.
fn steadiness() -> Check {
    let read =
        || (SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default(), Duration::from_nanos(monotonic_nanos()));
    let begin = read();
    std::thread::sleep(SPAN);
    let end = read();
    let difference = end.0.saturating_sub(begin.0).abs_diff(end.1.saturating_sub(begin.1));
    let state = if difference > MAX_DIFFERENCE { State::Warning } else { State::Ok };
    Check::ok(
        "clock step",
        format!("{:.1} ms in {} ms", difference.as_secs_f64() * 1e3, SPAN.as_millis()),
        format!("wall and monotonic clock agree within {} ms", MAX_DIFFERENCE.as_millis()),
    )
    .or(state, || "the clock is being set; wait until it is synchronized before a live run".to_owned())
}

fn synchronization() -> Check {
    let found = synchronized(&["timedatectl", "show", "--property=NTPSynchronized", "--value"], "yes", "no")
        .or_else(|| synchronized(&["chronyc", "-n", "tracking"], "Leap status     : Normal", "Not synchronised"));
    let (text, state) = match found {
        Some(true) => ("yes", State::Ok),
        Some(false) => ("no", State::Warning),
        None => ("unknown: neither timedatectl nor chronyc answers", State::Warning),
    };
    Check::ok("clock sync", text, "synchronized, for live runs")
        .or(state, || "start chrony or systemd-timesyncd; recorded drives do not need it".to_owned())
}

/// Whether the answer of a command contains `yes` (synchronized) or `no`; `None` without such an answer.
fn synchronized(command: &[&str], yes: &str, no: &str) -> Option<bool> {
    let (program, arguments) = command.split_first()?;
    let output = Command::new(program).args(arguments).stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match (text.contains(yes), text.contains(no)) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answer_of_a_time_service_is_read() {
        let says = |text: &str| synchronized(&["echo", text], "yes", "no");
        assert_eq!([says("yes"), says("no"), says("")], [Some(true), Some(false), None]);
        assert_eq!(synchronized(&["no-such-program"], "yes", "no"), None);
    }
}
