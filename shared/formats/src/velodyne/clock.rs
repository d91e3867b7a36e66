//! Converts "microseconds past the hour" to absolute time.
//!
//! The capture time of the first packet determines the hour. After that only the clock of the sensor is used, also across the end
//! of the hour, so the jitter of the capturing machine has no effect. If the clock of the sensor jumps, the clock of the capture
//! bridges the jump, so that time never decreases.

use geometry::Stamp;
use serde::{Deserialize, Serialize};

const HOUR_MICROS: i64 = 3_600_000_000;
const HOUR_NANOS: i64 = HOUR_MICROS * 1000;
/// A smaller step backwards is a reordered packet, not a clock that was set.
const LATE_MICROS: i64 = 50_000;
/// Largest difference of the two clocks between two packets: buffers hold a fraction of a second.
const TOLERANCE_MICROS: i64 = 2_000_000;

/// Clock of the stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum TimeBase {
    /// Clock of the sensor.
    Sensor,
    /// Clock of the capturing machine: early HDL-64E send no time.
    Capture,
}

/// State of the conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Clock {
    base: TimeBase,
    /// Offset of the capturing machine from UTC, ns, positive if it is ahead.
    host_ahead_nanos: i64,
    last: Option<Reading>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Reading {
    micros: u32,
    captured: Stamp,
    stamp: Stamp,
}

/// Position of a packet in the stream by its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It follows the previous packet by `nanos`.
    Forward { stamp: Stamp, nanos: i64 },
    /// It follows the previous packet, but the clock of the sensor jumped.
    Jump { stamp: Stamp },
    /// It has the time of the previous packet.
    Repeated { stamp: Stamp },
    /// It is older than the previous packet.
    Late,
}

impl Clock {
    pub(super) fn new(base: TimeBase, host_ahead_nanos: i64) -> Self {
        Self { base, host_ahead_nanos, last: None }
    }

    /// Whether gaps between stamps show lost packets.
    pub(super) fn is_regular(&self) -> bool {
        self.base == TimeBase::Sensor
    }

    /// The time of a packet. A late packet does not change the state.
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
        let is_plausible = i64::from(micros) < HOUR_MICROS && (delta - captured_delta).abs() < TOLERANCE_MICROS;
        match delta {
            0 if is_plausible => Step::Repeated { stamp: self.stamp },
            1.. if is_plausible => Step::Forward { stamp: self.stamp.plus_nanos(delta * 1000), nanos: delta * 1000 },
            _ if is_plausible && delta > -LATE_MICROS => Step::Late,
            _ => Step::Jump { stamp: self.stamp.plus_nanos(captured_delta.max(1) * 1000) },
        }
    }
}

/// The stamp nearest to `near` with these microseconds past an hour.
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
    fn hour_comes_from_the_capture_and_the_rest_from_the_sensor() {
        // The packet was captured 300 ms late, in the next hour.
        let step = sensor().step(3_599_900_000, HOUR.plus_nanos(200_000_000));
        assert_eq!(step, Step::Forward { stamp: HOUR.plus_nanos(-100_000_000), nanos: 0 });
        // The clock of the machine is five hours ahead of UTC.
        let mut ahead = Clock::new(TimeBase::Sensor, 5 * HOUR_NANOS);
        assert_eq!(ahead.step(7, HOUR), Step::Forward { stamp: HOUR.plus_nanos(7000 - 5 * HOUR_NANOS), nanos: 0 });
    }

    #[test]
    fn time_is_continuous_across_the_end_of_the_hour() {
        let mut clock = sensor();
        clock.step(3_599_999_800, HOUR.plus_nanos(-200_000));
        let next = clock.step(353, HOUR.plus_nanos(400_000));
        assert_eq!(next, Step::Forward { stamp: HOUR.plus_nanos(353_000), nanos: 553_000 });
    }

    #[test]
    fn repeated_late_and_lost_packets_are_distinguished() {
        let mut clock = sensor();
        clock.step(1_000_000, HOUR.plus_nanos(1_000_000_000));
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        assert_eq!(clock.step(1_000_000, at(1_000_100)), Step::Repeated { stamp: at(1_000_000) });
        assert_eq!(clock.step(999_447, at(1_000_200)), Step::Late);
        assert_eq!(clock.step(1_001_106, at(1_001_200)), Step::Forward { stamp: at(1_001_106), nanos: 1_106_000 });
    }

    #[test]
    fn clock_adjustment_does_not_decrease_stamps() {
        let mut clock = sensor();
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        clock.step(1_800_000_000, at(1_800_000_000));
        // The receiver gets a fix and sets the clock of the sensor back by ten minutes.
        assert_eq!(clock.step(1_200_000_553, at(1_800_000_553)), Step::Jump { stamp: at(1_800_000_553) });
        let next = clock.step(1_200_001_106, at(1_800_001_110));
        assert_eq!(next, Step::Forward { stamp: at(1_800_001_106), nanos: 553_000 });
        // An invalid time, then a capture whose clock was set back.
        assert_eq!(clock.step(u32::MAX, at(1_800_001_700)), Step::Jump { stamp: at(1_800_001_696) });
        assert_eq!(clock.step(5, at(0)), Step::Jump { stamp: at(1_800_001_697) });
    }
}
