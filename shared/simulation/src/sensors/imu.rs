//! The inertial unit: 100 samples per second in the body frame, with the gravity that it cannot tell from acceleration.

use crate::motion::Motion;
use crate::random::{gauss, hash, unit};
use formats::imu::ImuSample;
use geometry::Vector3;

/// ns between samples.
const PERIOD_NANOS: i64 = 10_000_000;
/// m/s^2.
const GRAVITY: f64 = 9.80665;
/// Noise of a sample, m/s^2 and rad/s: a good fiber-optic unit.
const NOISE: [f64; 2] = [0.01, 0.0005];
/// Largest constant bias, m/s^2 and rad/s.
const BIAS: [f64; 2] = [0.02, 0.0005];

/// All samples of a drive.
pub fn record(motion: &Motion, seconds: f64, seed: u64) -> Vec<ImuSample> {
    let bias = |kind: usize| Vector3::from_fn(|axis, _| BIAS[kind] * part(hash(seed, (kind * 3 + axis) as u64)));
    let biases = [bias(0), bias(1)];
    let n = (seconds * 1e9 / PERIOD_NANOS as f64) as i64;
    (0..=n)
        .map(|i| {
            let at = i as f64 * PERIOD_NANOS as f64 * 1e-9;
            let noise = |kind: usize| {
                Vector3::from_fn(|axis, _| {
                    NOISE[kind] * f64::from(gauss(hash(seed ^ 0x1, (i as u64) << 3 | (kind * 3 + axis) as u64)))
                })
            };
            let force = motion.acceleration(at) + Vector3::new(0.0, 0.0, GRAVITY);
            ImuSample {
                stamp: motion.begin.plus_nanos(i * PERIOD_NANOS),
                acceleration: (motion.pose(at).rotation.inverse() * force + biases[0] + noise(0)).into(),
                angular_rate: (motion.angular_rate(at) + biases[1] + noise(1)).into(),
            }
        })
        .collect()
}

fn part(hash: u64) -> f64 {
    2.0 * f64::from(unit(hash)) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example;
    use geometry::Stamp;

    #[test]
    fn samples_show_gravity_at_rest_and_turns_in_curves() {
        let motion = example(Stamp(5), 110.0);
        let samples = record(&motion, 10.0, 3);
        assert_eq!(samples.len(), 1001);
        assert!((Vector3::from(samples[0].acceleration).norm() - GRAVITY).abs() < 0.1);
        let turned: f64 = samples.iter().map(|s| s.angular_rate[2] * 0.01).sum();
        let yaw = |s: f64| motion.pose(s).rotation.euler_angles().2;
        assert!((turned - (yaw(10.0) - yaw(0.0))).abs() < 0.1 * (yaw(10.0) - yaw(0.0)).abs() + 0.006);
    }
}
