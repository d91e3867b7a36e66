//! Camera trigger: a fixed rate, and only if the vehicle has moved since the last exposure (thesis 2.5.1: 1 Hz, 1 m).

use crate::motion::Motion;
use geometry::Stamp;

/// Trigger of all cameras: a rate, and a minimum distance since the last exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerSpec {
    /// Exposures per second, 0.1 to 30.
    pub rate_hz: f64,
    /// Minimum distance since the last exposure, 0 to 100 m.
    pub way_m: f64,
}

/// Time of the first exposure after the start, ns: it does not coincide with the first firing of the lidar.
const FIRST_NANOS: i64 = 250_000_000;

/// Stamps of the exposures before `seconds`.
pub fn exposures(motion: &Motion, trigger: &TriggerSpec, seconds: f64) -> Vec<Stamp> {
    let period_nanos = (1e9 / trigger.rate_hz).round() as i64;
    let mut stamps = Vec::new();
    let mut last: Option<nalgebra::Vector3<f64>> = None;
    let mut at = FIRST_NANOS;
    while (at as f64) < seconds * 1e9 {
        let stamp = motion.begin.plus_nanos(at);
        let position = motion.pose_at(stamp).translation.vector;
        if last.is_none_or(|last| (position - last).norm() >= trigger.way_m) {
            stamps.push(stamp);
            last = Some(position);
        }
        at += period_nanos;
    }
    stamps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example;

    #[test]
    fn standing_vehicle_triggers_no_second_exposure() {
        let motion = example(Stamp(0), 110.0);
        let stamps = exposures(&motion, &TriggerSpec { rate_hz: 1.0, way_m: 1.0 }, 6.0);
        let seconds: Vec<f64> = stamps.iter().map(|s| s.0 as f64 * 1e-9).collect();
        // The vehicle is stationary at the start and moving at the end.
        assert_eq!((seconds[0], seconds[seconds.len() - 1]), (0.25, 5.25));
        let distance =
            |from: f64, to: f64| (motion.pose(to).translation.vector - motion.pose(from).translation.vector).norm();
        let mut last = 0.25;
        for second in [1.25, 2.25, 3.25, 4.25, 5.25] {
            assert_eq!(seconds.contains(&second), distance(last, second) >= 1.0, "{second} s");
            last = if seconds.contains(&second) { second } else { last };
        }
        assert!(seconds.len() < 6 && distance(0.25, 1.25) < 1.0);
        assert_eq!(exposures(&motion, &TriggerSpec { rate_hz: 5.0, way_m: 0.0 }, 6.0).len(), 29);
    }
}
