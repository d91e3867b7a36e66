//! Converts the times in packets to absolute time.
//!
//! Some sensors send the time past the hour, others the time since 1970 or since their start. The capture time of the first packet
//! determines the hour, or replaces a time that was never set. After that only the clock of the sensor is used, also across the end of
//! the hour, so the jitter of the capturing machine has no effect. If the clock of the sensor jumps, the clock of the capture bridges
//! the jump, so that time never decreases.

use geometry::Stamp;
use serde::{Deserialize, Serialize};

const HOUR_NANOS: i64 = 3_600_000_000_000;
/// A smaller step backwards is a reordered packet, not a clock that was set.
const LATE_NANOS: i64 = 50_000_000;
/// Largest difference of the two clocks between two packets: buffers delay packets by a fraction of a second.
const TOLERANCE_NANOS: i64 = 2_000_000_000;
/// Largest difference of a synchronized clock to the clock of the capture: the same as for a clock that reports only the
/// time past the hour.
const UNSET_NANOS: i64 = HOUR_NANOS / 2;

/// Origin of the times in packets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Epoch {
    /// The start of the hour.
    Hour,
    /// 1970, or the start of the sensor if its clock was never set.
    Unix,
}

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
    epoch: Epoch,
    /// Offset of the capturing machine from UTC, ns, positive if it is ahead.
    host_ahead_nanos: i64,
    last: Option<Reading>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Reading {
    nanos: i64,
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
    /// It follows the previous packet by the clock of the sensor, but the clock of the capture jumped by `nanos`.
    RecorderJump { stamp: Stamp, nanos: i64 },
    /// It was recorded after the previous packet, but both clocks show earlier times, the clock of the capture by `nanos`.
    SetBack { stamp: Stamp, nanos: i64 },
    /// It has the time of the previous packet.
    Repeated { stamp: Stamp },
    /// It is older than the previous packet.
    Late,
}

impl Clock {
    pub(super) fn new(base: TimeBase, epoch: Epoch, host_ahead_nanos: i64) -> Self {
        Self { base, epoch, host_ahead_nanos, last: None }
    }

    /// Whether gaps between stamps show lost packets.
    pub(super) fn is_regular(&self) -> bool {
        self.base == TimeBase::Sensor
    }

    /// Stamp of a packet from its time in ns. A late packet does not change the state.
    pub(super) fn step(&mut self, nanos: i64, captured: Stamp) -> Step {
        let captured = Stamp(captured.0.saturating_sub(self.host_ahead_nanos));
        let step = match (self.base, self.last) {
            (TimeBase::Capture, None) => Step::Forward { stamp: captured, nanos: 0 },
            (TimeBase::Capture, Some(last)) => {
                let stamp = captured.max(last.stamp);
                Step::Forward { stamp, nanos: stamp.0 - last.stamp.0 }
            }
            (TimeBase::Sensor, None) => Step::Forward { stamp: first_stamp(nanos, self.epoch, captured), nanos: 0 },
            (TimeBase::Sensor, Some(last)) => last.step(nanos, self.epoch, captured),
        };
        if let Step::Forward { stamp, .. }
        | Step::Jump { stamp }
        | Step::RecorderJump { stamp, .. }
        | Step::SetBack { stamp, .. } = step
        {
            self.last = Some(Reading { nanos, captured, stamp });
        }
        step
    }
}

impl Reading {
    fn step(&self, nanos: i64, epoch: Epoch, captured: Stamp) -> Step {
        let delta = nanos.saturating_sub(self.nanos);
        let (delta, is_valid) = match epoch {
            Epoch::Hour => {
                let half = HOUR_NANOS / 2;
                ((delta + half).rem_euclid(HOUR_NANOS) - half, nanos < HOUR_NANOS)
            }
            Epoch::Unix => (delta, true),
        };
        // Captures have microseconds.
        let captured_delta = captured.0.saturating_sub(self.captured.0) / 1000 * 1000;
        let is_plausible = is_valid && delta.saturating_sub(captured_delta).abs() < TOLERANCE_NANOS;
        match delta {
            0 if is_plausible => Step::Repeated { stamp: self.stamp },
            1.. if is_plausible => Step::Forward { stamp: self.stamp.plus_nanos(delta), nanos: delta },
            _ if is_plausible && delta > -LATE_NANOS => Step::Late,
            // A sensor whose clock went on counts, even if the clock of the capture was set back.
            _ if captured_delta < -TOLERANCE_NANOS && !(is_valid && (0..TOLERANCE_NANOS).contains(&delta)) => {
                Step::SetBack { stamp: self.stamp.plus_nanos(1000), nanos: captured_delta.saturating_neg() }
            }
            1..TOLERANCE_NANOS if is_valid => {
                // A clock that was set, of a sensor that sends the date, is right.
                let is_set =
                    epoch == Epoch::Unix && self.stamp.0.saturating_sub(self.nanos).saturating_abs() < UNSET_NANOS;
                let stamp = self.stamp.plus_nanos(if is_set { delta } else { captured_delta.max(1000) });
                Step::RecorderJump { stamp, nanos: captured_delta }
            }
            _ => Step::Jump { stamp: self.stamp.plus_nanos(captured_delta.max(1000)) },
        }
    }
}

/// The stamp of the first packet.
fn first_stamp(nanos: i64, epoch: Epoch, captured: Stamp) -> Stamp {
    match epoch {
        Epoch::Hour => {
            let hours = (captured.0 - nanos + HOUR_NANOS / 2).div_euclid(HOUR_NANOS);
            Stamp(hours * HOUR_NANOS + nanos)
        }
        Epoch::Unix if nanos.saturating_sub(captured.0).saturating_abs() < UNSET_NANOS => Stamp(nanos),
        Epoch::Unix => captured,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Stamp = Stamp(1_600_000_000_000_000_000 / HOUR_NANOS * HOUR_NANOS);

    fn sensor() -> Clock {
        Clock::new(TimeBase::Sensor, Epoch::Hour, 0)
    }

    #[test]
    fn hour_comes_from_the_capture_and_the_rest_from_the_sensor() {
        // The packet was captured 300 ms late, in the next hour.
        let step = sensor().step(3_599_900_000_000, HOUR.plus_nanos(200_000_000));
        assert_eq!(step, Step::Forward { stamp: HOUR.plus_nanos(-100_000_000), nanos: 0 });
        // The clock of the machine is five hours ahead of UTC.
        let mut ahead = Clock::new(TimeBase::Sensor, Epoch::Hour, 5 * HOUR_NANOS);
        assert_eq!(ahead.step(7_000, HOUR), Step::Forward { stamp: HOUR.plus_nanos(7000 - 5 * HOUR_NANOS), nanos: 0 });
    }

    #[test]
    fn time_is_continuous_across_the_end_of_the_hour() {
        let mut clock = sensor();
        clock.step(3_599_999_800_000, HOUR.plus_nanos(-200_000));
        let next = clock.step(353_000, HOUR.plus_nanos(400_000));
        assert_eq!(next, Step::Forward { stamp: HOUR.plus_nanos(353_000), nanos: 553_000 });
    }

    #[test]
    fn repeated_late_and_lost_packets_are_distinguished() {
        let mut clock = sensor();
        clock.step(1_000_000_000, HOUR.plus_nanos(1_000_000_000));
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        assert_eq!(clock.step(1_000_000_000, at(1_000_100)), Step::Repeated { stamp: at(1_000_000) });
        assert_eq!(clock.step(999_447_000, at(1_000_200)), Step::Late);
        assert_eq!(clock.step(1_001_106_000, at(1_001_200)), Step::Forward { stamp: at(1_001_106), nanos: 1_106_000 });
    }

    #[test]
    fn clock_adjustment_does_not_decrease_stamps() {
        let mut clock = sensor();
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        clock.step(1_800_000_000_000, at(1_800_000_000));
        // The receiver gets a fix and sets the clock of the sensor back by ten minutes.
        assert_eq!(clock.step(1_200_000_553_000, at(1_800_000_553)), Step::Jump { stamp: at(1_800_000_553) });
        let next = clock.step(1_200_001_106_000, at(1_800_001_110));
        assert_eq!(next, Step::Forward { stamp: at(1_800_001_106), nanos: 553_000 });
        // An invalid time, then a capture whose clock was set back.
        assert_eq!(clock.step(i64::from(u32::MAX) * 1000, at(1_800_001_700)), Step::Jump { stamp: at(1_800_001_696) });
        let back = Step::SetBack { stamp: at(1_800_001_697), nanos: 1_800_001_700_000 };
        assert_eq!(clock.step(5_000, at(0)), back);
    }

    #[test]
    fn step_back_of_both_clocks_differs_from_a_step_back_of_one() {
        let at = |micros: i64| HOUR.plus_nanos(micros * 1000);
        let begun = || {
            let mut clock = sensor();
            clock.step(1_800_000_000_000, at(1_800_000_000));
            clock
        };
        let expected = Step::SetBack { stamp: at(1_800_000_001), nanos: 600_000_000_000 };
        assert_eq!(begun().step(1_200_000_553_000, at(1_200_000_000)), expected);
        // Only the clock of the sensor, then only the clock of the capture.
        let stamp = at(1_800_000_553);
        assert_eq!(begun().step(1_200_000_553_000, at(1_800_000_553)), Step::Jump { stamp });
        let jump = Step::RecorderJump { stamp: at(1_800_000_001), nanos: -600_000_000_000 };
        assert_eq!(begun().step(1_800_000_553_000, at(1_200_000_000)), jump);
        let jump = Step::RecorderJump { stamp: at(5_400_000_553), nanos: 3_600_000_553_000 };
        assert_eq!(begun().step(1_800_000_553_000, at(5_400_000_553)), jump);
    }

    #[test]
    fn clock_of_the_recorder_that_jumps_does_not_move_a_sensor_that_sends_the_date() {
        for jump_nanos in [-5_000_000_000, 7_000_000_000] {
            let mut clock = Clock::new(TimeBase::Sensor, Epoch::Unix, 0);
            clock.step(HOUR.0, HOUR);
            let stamp = HOUR.plus_nanos(600_000);
            let step = clock.step(stamp.0, stamp.plus_nanos(jump_nanos));
            assert_eq!(step, Step::RecorderJump { stamp, nanos: 600_000 + jump_nanos });
            let stamp = HOUR.plus_nanos(1_200_000);
            let step = clock.step(stamp.0, stamp.plus_nanos(jump_nanos));
            assert_eq!(step, Step::Forward { stamp, nanos: 600_000 });
        }
    }

    #[test]
    fn clock_of_the_sensor_counts_if_it_is_near_the_capture() {
        let clock = || Clock::new(TimeBase::Sensor, Epoch::Unix, 0);
        let sent = HOUR.0 - 1_500_000_000;
        assert_eq!(clock().step(sent, HOUR), Step::Forward { stamp: Stamp(sent), nanos: 0 });
        // 40 s after the start of a sensor without a reference: the capture determines the start, the sensor the rest.
        let mut unset = clock();
        assert_eq!(unset.step(40_000_000_000, HOUR), Step::Forward { stamp: HOUR, nanos: 0 });
        let next = unset.step(40_000_123_456, HOUR.plus_nanos(777_000));
        assert_eq!(next, Step::Forward { stamp: HOUR.plus_nanos(123_456), nanos: 123_456 });
        assert_eq!(unset.step(40_000_000_500, HOUR.plus_nanos(800_000)), Step::Late);
        // The sensor gets a reference.
        let set = unset.step(HOUR.0 + 2_000_000, HOUR.plus_nanos(1_777_000));
        assert_eq!(set, Step::Jump { stamp: HOUR.plus_nanos(1_123_456) });
        assert_eq!(clock().step(i64::MAX, Stamp(0)), Step::Forward { stamp: Stamp(0), nanos: 0 });
    }
}
