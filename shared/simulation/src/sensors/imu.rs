//! IMU: specific force (gravity included) and angular rate (Earth rotation included) in the body axes, with sensor errors.

use crate::motion::Motion;
use crate::sensors::gnss::ORIGIN;
use crate::sensors::gnss::sky::EARTH_RATE;
use drive::imu::ImuSample;
use geometry::{Point3, Vector3};
use random::{gauss, hash};

/// Gravity, m/s^2.
const GRAVITY: f64 = 9.80665;
/// Correlation time of the bias drift, s: the minimum of Allan plots is at some minutes.
const WANDER_SECONDS: f64 = 300.0;
/// Vibration by engine and road at full speed, m/s^2. At 20 Hz and above this is less than 20 µm, below the resolution of
/// the other sensors.
const VIBRATION: f64 = 0.1;
/// Speed of full vibration, m/s.
const VIBRATION_MPS: f64 = 10.0;
/// One degree per hour, rad/s.
const DEG_PER_HOUR: f64 = std::f64::consts::PI / 180.0 / 3600.0;
/// One thousandth of gravity, m/s^2.
const MILLI_G: f64 = GRAVITY * 1e-3;

/// Grade of an inertial unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grade {
    /// Fiber-optic gyroscopes and quartz or fine MEMS accelerometers, as in the KVH 1750 class.
    Tactical,
    /// An industrial MEMS unit, as in the Xsens MTi-100 class.
    Mems,
}

/// An inertial unit whose axes are the body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSpec {
    /// Grade.
    pub grade: Grade,
    /// Samples per second, 10 to 1000.
    pub rate_hz: f64,
    /// Position of the accelerometers, m.
    pub position_in_body: [f64; 3],
}

/// Errors of three accelerometers or gyroscopes, in m/s^2 or rad/s.
struct Errors {
    /// Turn-on bias, standard deviation.
    bias: f64,
    /// Bias drift during a drive, standard deviation.
    wander: f64,
    /// White noise, per root of Hz.
    noise_density: f64,
    /// Scale factor error, standard deviation.
    scale: f64,
}

impl Grade {
    /// All grades.
    pub const ALL: [Self; 2] = [Self::Tactical, Self::Mems];

    /// Name in rig files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tactical => "tactical",
            Self::Mems => "mems",
        }
    }

    /// Errors of accelerometers and gyroscopes, rounded from data sheets of the class. Tactical: offset 2 mg and 2 deg/h,
    /// instability 0.05 mg and 0.1 deg/h, 0.12 mg per root Hz and 0.012 deg per root h, 300 and 100 ppm. MEMS: offset 3
    /// mg and 0.2 deg/s, instability 0.04 mg and 10 deg/h, 0.08 mg and 0.01 deg/s per root Hz, 500 ppm each.
    const fn errors(self) -> [Errors; 2] {
        match self {
            Self::Tactical => [
                Errors { bias: 2.0 * MILLI_G, wander: 0.05 * MILLI_G, noise_density: 0.12 * MILLI_G, scale: 300e-6 },
                // 0.012 deg per root h are 0.72 deg/h per root Hz.
                Errors {
                    bias: 2.0 * DEG_PER_HOUR,
                    wander: 0.1 * DEG_PER_HOUR,
                    noise_density: 0.72 * DEG_PER_HOUR,
                    scale: 100e-6,
                },
            ],
            Self::Mems => [
                Errors { bias: 3.0 * MILLI_G, wander: 0.04 * MILLI_G, noise_density: 0.08 * MILLI_G, scale: 500e-6 },
                Errors {
                    bias: 720.0 * DEG_PER_HOUR,
                    wander: 10.0 * DEG_PER_HOUR,
                    noise_density: 36.0 * DEG_PER_HOUR,
                    scale: 500e-6,
                },
            ],
        }
    }
}

/// All samples of a drive.
pub fn record(motion: &Motion, spec: &ImuSpec, seconds: f64, seed: u64) -> Vec<ImuSample> {
    let period_nanos = (1e9 / spec.rate_hz).round() as i64;
    let [mut accelerometers, mut gyroscopes] = {
        let [force, rate] = spec.grade.errors();
        [Triad::new(&force, spec.rate_hz, hash(seed, 0)), Triad::new(&rate, spec.rate_hz, hash(seed, 1))]
    };
    // Earth rotation in the world frame.
    let (sin, cos) = ORIGIN.latitude_deg.to_radians().sin_cos();
    let earth_rate = Vector3::new(0.0, cos, sin) * EARTH_RATE;
    let n = (seconds * 1e9 / period_nanos as f64) as i64;
    (0..=n)
        .map(|i| {
            let at = (i * period_nanos) as f64 * 1e-9;
            let body_from_world = motion.pose(at).rotation.inverse();
            let force = acceleration(motion, at, &spec.position_in_body) + Vector3::z() * GRAVITY;
            let vibration = VIBRATION * (motion.velocity(at).norm() / VIBRATION_MPS).min(1.0);
            let rate = motion.angular_rate(at) + body_from_world * earth_rate;
            ImuSample {
                stamp: motion.begin.plus_nanos(i * period_nanos),
                acceleration: accelerometers.measure(&(body_from_world * force), vibration).into(),
                angular_rate: gyroscopes.measure(&rate, 0.0).into(),
            }
        })
        .collect()
}

/// Acceleration of a point of the body in the world, m/s^2, lever arm included.
fn acceleration(motion: &Motion, seconds: f64, position_in_body: &[f64; 3]) -> Vector3<f64> {
    // 1 ms: truncation and rounding of the second difference are both below 1e-5 m/s^2 within a kilometre of the origin.
    let h = 1e-3;
    let at = |s: f64| (motion.pose(s) * Point3::from(*position_in_body)).coords;
    (at(seconds + h) - 2.0 * at(seconds) + at(seconds - h)) / (h * h)
}

/// Three equal sensors, one along each axis.
struct Triad {
    bias: Vector3<f64>,
    scale: Vector3<f64>,
    /// White noise of a sample.
    noise: f64,
    /// First-order Gauss-Markov process of the bias drift: factor and noise per sample.
    memory: f64,
    gain: f64,
    wander: Vector3<f64>,
    seed: u64,
    sample: u64,
}

impl Triad {
    fn new(errors: &Errors, rate_hz: f64, seed: u64) -> Self {
        let draw = |kind: u64, sigma: f64| normal(hash(seed, kind)) * sigma;
        let memory = (-1.0 / (rate_hz * WANDER_SECONDS)).exp();
        Self {
            bias: draw(0, errors.bias),
            scale: draw(1, errors.scale),
            // A sample is the mean over its period: the noise of half the rate's bandwidth.
            noise: errors.noise_density * rate_hz.sqrt(),
            memory,
            gain: errors.wander * (1.0 - memory * memory).sqrt(),
            wander: draw(2, errors.wander),
            seed,
            sample: 0,
        }
    }

    /// The next sample of a true value, with vibration of the given strength.
    fn measure(&mut self, truth: &Vector3<f64>, vibration: f64) -> Vector3<f64> {
        let of = hash(self.seed, 16 + self.sample);
        self.sample += 1;
        let measured = truth + truth.component_mul(&self.scale) + self.bias + self.wander;
        self.wander = self.wander * self.memory + normal(hash(of, 1)) * self.gain;
        measured + normal(hash(of, 2)) * self.noise.hypot(vibration)
    }
}

/// Three normal numbers.
fn normal(of: u64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| f64::from(gauss(hash(of, axis as u64))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::example;
    use geometry::Stamp;

    fn motion() -> Motion {
        example(Stamp(5), 110.0)
    }

    fn spec(grade: Grade, position_in_body: [f64; 3]) -> ImuSpec {
        ImuSpec { grade, rate_hz: 200.0, position_in_body }
    }

    fn mean(samples: &[ImuSample], of: impl Fn(&ImuSample) -> [f64; 3]) -> Vector3<f64> {
        samples.iter().map(|sample| Vector3::from(of(sample))).sum::<Vector3<f64>>() / samples.len() as f64
    }

    #[test]
    fn samples_contain_gravity_and_turn_rate() {
        let motion = motion();
        for grade in Grade::ALL {
            let samples = record(&motion, &spec(grade, [0.0; 3]), 10.0, 3);
            assert_eq!(samples.len(), 2001);
            assert_eq!(samples[1].stamp.0 - samples[0].stamp.0, 5_000_000);
            assert!((Vector3::from(samples[0].acceleration).norm() - GRAVITY).abs() < 0.15);
            let turned: f64 = samples.iter().map(|s| s.angular_rate[2] * 0.005).sum();
            let yaw = |s: f64| motion.pose(s).rotation.euler_angles().2;
            // Over 10 s a MEMS gyroscope drifts by 10 times its offset, half a degree per second at most.
            let drift = if grade == Grade::Mems { 0.1 } else { 1e-3 };
            assert!((turned - (yaw(10.0) - yaw(0.0))).abs() < drift, "{turned} {}", yaw(10.0) - yaw(0.0));
        }
    }

    fn mean_truth(
        motion: &Motion,
        samples: &[ImuSample],
        truth: impl Fn(&Motion, f64) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let at = |sample: &ImuSample| sample.stamp.seconds_since(motion.begin);
        samples.iter().map(|sample| truth(motion, at(sample))).sum::<Vector3<f64>>() / samples.len() as f64
    }

    fn true_force(motion: &Motion, at: f64) -> Vector3<f64> {
        motion.pose(at).rotation.inverse() * (motion.acceleration(at) + Vector3::z() * GRAVITY)
    }

    fn true_rate(motion: &Motion, at: f64) -> Vector3<f64> {
        // 15 degrees an hour about the axis of the Earth, which points 48.8 degrees above north.
        let earth = Vector3::new(0.0, 0.658, 0.753) * 7.292e-5;
        motion.angular_rate(at) + motion.pose(at).rotation.inverse() * earth
    }

    #[test]
    fn errors_match_the_grade() {
        let motion = motion();
        for grade in Grade::ALL {
            let [force, rate] = grade.errors();
            let mut biases = [0.0; 2];
            let mut n = 0.0;
            for seed in 0..60 {
                let samples = record(&motion, &spec(grade, [0.0; 3]), 0.3, seed);
                let off = [
                    mean(&samples, |s| s.acceleration) - mean_truth(&motion, &samples, true_force),
                    mean(&samples, |s| s.angular_rate) - mean_truth(&motion, &samples, true_rate),
                ];
                biases[0] += off[0].xy().norm_squared();
                biases[1] += off[1].xy().norm_squared();
                n += 2.0;
            }
            // Averaging 61 samples reduces their noise to an eighth.
            for (found, errors) in biases.map(|sum| (sum / n).sqrt()).into_iter().zip([force, rate]) {
                let expected = errors.bias.hypot(errors.noise_density * 200.0_f64.sqrt() / 61.0_f64.sqrt());
                assert!((0.75..1.25).contains(&(found / expected)), "{grade:?}: {found}, {expected}");
            }
        }
    }

    #[test]
    fn lever_arm_adds_rotational_acceleration() {
        let motion = motion();
        let arm = Vector3::new(2.0, 0.5, -1.0);
        let differences = |at: f64| {
            let there = acceleration(&motion, at, &arm.into()) - acceleration(&motion, at, &[0.0; 3]);
            let pose = motion.pose(at).rotation;
            let omega = |s: f64| pose * motion.angular_rate(s);
            let alpha = (omega(at + 1e-3) - omega(at - 1e-3)) / 2e-3;
            let arm = pose * arm;
            let by_mechanics = alpha.cross(&arm) + omega(at).cross(&omega(at).cross(&arm));
            (there.norm(), (there - by_mechanics).norm())
        };
        let (lever, off) = (10..60)
            .map(|i| differences(f64::from(i) * 0.1))
            .fold((0.0_f64, 0.0_f64), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        assert!(lever > 0.02 && off < 0.05 * lever, "{lever} m/s^2, off by {off}");
    }
}
