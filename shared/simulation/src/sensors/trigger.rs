//! When the cameras fire: once a second, and only if the vehicle has moved 1 m since the last time (thesis 2.5.1).

use crate::motion::Motion;
use geometry::Stamp;

/// After the begin, ns: no shot coincides with the first firing of the lidar.
const FIRST_NANOS: i64 = 250_000_000;
const PERIOD_NANOS: i64 = 1_000_000_000;
const MOVED_M: f64 = 1.0;

/// Stamps of the exposures before `seconds`.
pub fn exposures(motion: &Motion, seconds: f64) -> Vec<Stamp> {
    let mut stamps = Vec::new();
    let mut last: Option<nalgebra::Vector3<f64>> = None;
    let mut at = FIRST_NANOS;
    while (at as f64) < seconds * 1e9 {
        let stamp = motion.begin.plus_nanos(at);
        let position = motion.pose_at(stamp).translation.vector;
        if last.is_none_or(|last| (position - last).norm() >= MOVED_M) {
            stamps.push(stamp);
            last = Some(position);
        }
        at += PERIOD_NANOS;
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
        let stamps = exposures(&motion, 6.0);
        // The vehicle has moved less than 1 m after its first second.
        let seconds: Vec<f64> = stamps.iter().map(|s| s.0 as f64 * 1e-9).collect();
        assert_eq!(seconds, [0.25, 2.25, 3.25, 4.25, 5.25]);
    }
}
