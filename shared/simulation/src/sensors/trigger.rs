//! When the cameras fire: at a rate, and only if the vehicle has moved since the last time (thesis 2.5.1: once a second, 1 m).

use crate::motion::Motion;
use crate::rig::TriggerSpec;
use geometry::Stamp;

/// After the begin, ns: no shot coincides with the first firing of the lidar.
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
    fn a_standing_vehicle_takes_no_second_picture() {
        let motion = example(Stamp(0), 110.0);
        let stamps = exposures(&motion, &TriggerSpec { rate_hz: 1.0, way_m: 1.0 }, 6.0);
        // The vehicle has moved less than 1 m after its first second.
        let seconds: Vec<f64> = stamps.iter().map(|s| s.0 as f64 * 1e-9).collect();
        assert!(
            seconds[0] == 0.25 && !seconds.contains(&1.25) && seconds.ends_with(&[3.25, 4.25, 5.25]),
            "{seconds:?}"
        );
        assert_eq!(exposures(&motion, &TriggerSpec { rate_hz: 5.0, way_m: 0.0 }, 6.0).len(), 29);
    }
}
