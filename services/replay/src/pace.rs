//! The pace of a replay: drive time against wall-clock time.

use std::time::{Duration, Instant};

/// Longest pause. Longer pauses of the drive are shortened to this: waiting at a traffic light again is useless, and
/// the supervisor treats a stage without progress as hanging.
const MAX_WAIT: Duration = Duration::from_secs(5);

/// Delays ticks until they are due.
pub struct Pace {
    /// Drive time per wall-clock time; 0 = no waiting.
    speed: f64,
    /// Time at which the last tick was due, and its drive time.
    last: Option<(Instant, i64)>,
}

impl Pace {
    /// A pace of `speed`: drive time per wall-clock time, 0 = as fast as possible.
    pub fn new(speed: f64) -> Self {
        Self { speed, last: None }
    }

    /// Time from the previous tick to this one; zero for the first.
    fn due_after(&self, drive_time: i64) -> Duration {
        let Some((_, last)) = self.last.filter(|_| self.speed > 0.0) else { return Duration::ZERO };
        let nanos = drive_time.saturating_sub(last).max(0) as f64 / self.speed;
        Duration::from_nanos(nanos as u64).min(MAX_WAIT)
    }

    /// Sleeps until the tick at `drive_time` is due. A late tick does not delay later ones.
    pub fn wait_for(&mut self, drive_time: i64) {
        let now = Instant::now();
        let due = self.last.map_or(now, |(when, _)| when + self.due_after(drive_time));
        std::thread::sleep(due.saturating_duration_since(now));
        self.last = Some((due, drive_time));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_due_by_drive_time_and_speed() {
        let begun = Instant::now();
        let at = |speed| Pace { speed, last: Some((begun, 1_000_000_000)) };
        assert_eq!(at(1.0).due_after(1_100_000_000), Duration::from_millis(100));
        assert_eq!(at(4.0).due_after(1_100_000_000), Duration::from_millis(25));
        assert_eq!(at(0.0).due_after(1_100_000_000), Duration::ZERO);
        assert_eq!(at(1.0).due_after(900_000_000), Duration::ZERO, "a drive's clock may have been set back");
        assert_eq!(at(1.0).due_after(600_000_000_000), MAX_WAIT);
        assert_eq!(Pace::new(1.0).due_after(i64::MAX), Duration::ZERO, "the first is due at once");
    }
}
