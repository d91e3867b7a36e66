//! From "microseconds past the hour" to absolute time.
//!
//! The sensor does not say which hour; the capture's own stamp does, once, for the first packet. From there on the
//! sensor's clock alone counts, over the end of the hour and without the jitter of the capturing machine. Where the
//! sensor's clock jumps, the capture's clock bridges the jump, so that time never runs backwards.

use geometry::Stamp;
use serde::{Deserialize, Serialize};

const HOUR_MICROS: i64 = 3_600_000_000;
const HOUR_NANOS: i64 = HOUR_MICROS * 1000;
/// Going back by less is a packet that was overtaken on its way, not a clock that was set.
const LATE_MICROS: i64 = 50_000;
/// How far the two clocks may go apart between two packets: buffers hold a fraction of a second.
const TOLERANCE_MICROS: i64 = 2_000_000;

/// Which clock the stamps come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum TimeBase {
    /// The sensor's.
    Sensor,
    /// The capturing machine's: the sensor sends no time (early HDL-64E).
    Capture,
}

/// State of the conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Clock {
    base: TimeBase,
    /// How much the capturing machine is ahead of UTC, ns.
    host_ahead_nanos: i64,
    last: Option<Reading>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Reading {
    micros: u32,
    captured: Stamp,
    stamp: Stamp,
}

/// What a packet's time says about its place in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It follows; so much later than its predecessor.
    Forward { stamp: Stamp, nanos: i64 },
    /// It follows, but the sensor's clock cannot say when.
    Jump { stamp: Stamp },
    /// It has the time of its predecessor.
    Repeated { stamp: Stamp },
    /// It is older than its predecessor.
    Late,
}

impl Clock {
    pub(super) fn new(base: TimeBase, host_ahead_nanos: i64) -> Self {
        Self { base, host_ahead_nanos, last: None }
    }

    /// Whether gaps between stamps are gaps between packets.
    pub(super) fn is_regular(&self) -> bool {
        self.base == TimeBase::Sensor
    }

    /// The time of a packet. A late one leaves no trace.
    pub(super) fn step(&mut self, micros: u32, captured: Stamp) -> Step {
        let captured = Stamp(captured.0.saturating_sub(self.host_ahead_nanos));
        let step = match (self.base, self.last) {
            (TimeBase::Capture, None) => Step::Forward { stamp: captured, nanos: 0 },
            (TimeBase::Capture, Some(last)) => {
                let stamp = captured.max(last.stamp);
                Step::Forward { stamp, nanos: stamp.0 - last.stamp.0 }
            }
            (TimeBase::Sensor, None) => Step::Forward { stamp: stamp_near(micros, captured), nanos: 0 },
            (TimeBase::Sensor, Some(last)) => last.step(micros, captured),
        };
        if let Step::Forward { stamp, .. } | Step::Jump { stamp } = step {
            self.last = Some(Reading { micros, captured, stamp });
        }
        step
    }
}

impl Reading {
    fn step(&self, micros: u32, captured: Stamp) -> Step {
        let delta =
            (i64::from(micros) - i64::from(self.micros) + HOUR_MICROS / 2).rem_euclid(HOUR_MICROS) - HOUR_MICROS / 2;
        let captured_delta = (captured.0 - self.captured.0) / 1000;
        let is_sound = i64::from(micros) < HOUR_MICROS && (delta - captured_delta).abs() < TOLERANCE_MICROS;
        match delta {
            0 if is_sound => Step::Repeated { stamp: self.stamp },
            1.. if is_sound => Step::Forward { stamp: self.stamp.plus_nanos(delta * 1000), nanos: delta * 1000 },
            _ if is_sound && delta > -LATE_MICROS => Step::Late,
            _ => Step::Jump { stamp: self.stamp.plus_nanos(captured_delta.max(1) * 1000) },
        }
    }
}

/// The stamp with these microseconds past an hour that is nearest to `near`.
fn stamp_near(micros: u32, near: Stamp) -> Stamp {
    let past_hour = i64::from(micros) * 1000;
    let hours = (near.0 - past_hour + HOUR_NANOS / 2).div_euclid(HOUR_NANOS);
    Stamp(hours * HOUR_NANOS + past_hour)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Stamp = Stamp(1_600_000_000_000_000_000 / HOUR_NANOS * HOUR_NANOS);

    fn sensor() -> Clock {
        Clock::new(TimeBase::Sensor, 0)
    }

    #[test]
    fn the_hour_comes_from_the_capture_and_the_rest_from_the_sensor() {
        // The capture saw it 300 ms late, in the next hour already.
        let step = sensor().step(3_599_900_000, HOUR.plus_nanos(200_000_000));
        assert_eq!(step, Step::Forward { stamp: HOUR.plus_nanos(-100_000_000), nanos: 0 });
        // A machine that is five hours ahead of the satellites.
        let mut ahead = Clock::new(TimeBase::Sensor, 5 * HOUR_NANOS);
        assert_eq!(ahead.step(7, HOUR), Step::Forward { stamp: HOUR.plus_nanos(7000 - 5 * HOUR_NANOS), nanos: 0 });
    }

    #[test]
    fn time_goes_on_over_the_end_of_the_hour() {
        let mut clock = sensor();
        clock.step(3_599_999_800, HOUR.plus_nanos(-200_000));
        let next = clock.step(353, HOUR.plus_nanos(400_000));
        assert_eq!(next, Step::Forward { stamp: HOUR.plus_nanos(353_000), nanos: 553_000 });
    }

    #[test]
    fn repeated_late_and_lost_packets_are_told_apart() {
        let mut clock = sensor();
        clock.step(1_000_000, HOUR.plus_nanos(1_000_000_000));
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        assert_eq!(clock.step(1_000_000, at(1_000_100)), Step::Repeated { stamp: at(1_000_000) });
        assert_eq!(clock.step(999_447, at(1_000_200)), Step::Late);
        assert_eq!(clock.step(1_001_106, at(1_001_200)), Step::Forward { stamp: at(1_001_106), nanos: 1_106_000 });
    }

    #[test]
    fn a_clock_that_is_set_moves_no_stamp_back() {
        let mut clock = sensor();
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        clock.step(1_800_000_000, at(1_800_000_000));
        // The receiver finds its satellites: the sensor's clock falls by ten minutes.
        assert_eq!(clock.step(1_200_000_553, at(1_800_000_553)), Step::Jump { stamp: at(1_800_000_553) });
        let next = clock.step(1_200_001_106, at(1_800_001_110));
        assert_eq!(next, Step::Forward { stamp: at(1_800_001_106), nanos: 553_000 });
        // Nonsense in the field, and a capture whose clock was set back, too.
        assert_eq!(clock.step(u32::MAX, at(1_800_001_700)), Step::Jump { stamp: at(1_800_001_696) });
        assert_eq!(clock.step(5, at(0)), Step::Jump { stamp: at(1_800_001_697) });
    }
}
