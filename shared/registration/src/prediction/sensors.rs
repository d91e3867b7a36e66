//! Measurements of other sensors, buffered until the sweep of their time is registered.

use geometry::{Point3, Pose, Stamp, Vector3};
use messages::{GnssRow, ImuRow};
use serde::{Deserialize, Serialize};

/// Longer pauses between inertial samples are gaps, ns: samples at 20 Hz still resolve the motion of a car.
const GAP_NANOS: i64 = 60_000_000;
/// Time for which used samples are kept, ns.
const KEPT_NANOS: i64 = 600_000_000;
/// Largest number of buffered samples: a minute at 1 kHz. The oldest are dropped first.
const MAX_WAITING: usize = 60_000;
/// Window of standstill detection, and the largest scatter of its samples: m/s^2 and rad/s, root mean square of all
/// axes. An idling engine vibrates by some hundredths.
const STILL_NANOS: i64 = 500_000_000;
const STILL_MPS2: f64 = 0.1;
const STILL_RADPS: f64 = 0.015;
/// Speed error of a receiver at a dilution of 1, m/s along each axis: data sheets specify 0.05 under an open sky.
const SPEED_MPS: f64 = 0.1;
/// Below this speed the course is noise, m/s.
const LEAST_COURSE_MPS: f64 = 0.5;

/// Mounting of the sensors on the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorMounting {
    /// Pose of the LiDAR in the body frame.
    pub body_from_lidar: Pose,
    /// Position of the inertial unit, m.
    pub imu_in_body: Point3<f64>,
    /// Position of the GNSS antenna, m.
    pub antenna_in_body: Point3<f64>,
}

impl Default for SensorMounting {
    /// All frames coincide.
    fn default() -> Self {
        let origin = Point3::origin();
        Self { body_from_lidar: Pose::identity(), imu_in_body: origin, antenna_in_body: origin }
    }
}

/// A sample of an inertial unit along the body's axes (x forward, y left, z up).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InertialSample {
    /// Time of the sample.
    pub stamp: Stamp,
    /// Specific force, m/s^2: at rest 9.81 upwards.
    pub force: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
}

impl From<&ImuRow> for InertialSample {
    fn from(row: &ImuRow) -> Self {
        Self { stamp: Stamp(row.stamp), force: row.acceleration.into(), rate: row.angular_rate.into() }
    }
}

impl From<&InertialSample> for ImuRow {
    fn from(sample: &InertialSample) -> Self {
        Self { stamp: sample.stamp.0, acceleration: sample.force.into(), angular_rate: sample.rate.into() }
    }
}

/// Horizontal velocity of a GNSS antenna.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroundVelocity {
    /// Time of the velocity.
    pub stamp: Stamp,
    /// Towards east and north, m/s.
    pub east_north: [f64; 2],
    /// Standard deviation of each, m/s.
    pub sigma: f64,
    /// Standard deviation of the stamp, s: while the vehicle accelerates, it adds to the velocity's.
    pub late_sigma_s: f64,
}

impl GroundVelocity {
    /// Creates a velocity from a receiver's speed (m/s), course (degrees clockwise from north, `None` if unknown) and
    /// dilution of precision. Receivers measure both by Doppler shifts, which reflections disturb far less than
    /// positions. `None` if the direction is unknown.
    pub fn new(stamp: Stamp, speed: f64, course_deg: Option<f64>, hdop: Option<f64>) -> Option<Self> {
        let sigma = SPEED_MPS * hdop.unwrap_or(2.0).max(1.0);
        let (east, north) = match course_deg {
            Some(course) if speed >= LEAST_COURSE_MPS => course.to_radians().sin_cos(),
            None if speed > LEAST_COURSE_MPS => return None,
            // The antenna stands, or moves slowly in an unknown direction.
            _ => return Some(Self { stamp, east_north: [0.0; 2], sigma: sigma.hypot(speed), late_sigma_s: 0.0 }),
        };
        let is_number = speed.is_finite() && east.is_finite();
        is_number.then_some(Self { stamp, east_north: [speed * east, speed * north], sigma, late_sigma_s: 0.0 })
    }
    /// The velocity of a receiver whose stamps are late by `late_s`, with a standard deviation.
    #[must_use]
    pub fn with_delay(self, late_s: f64, late_sigma_s: f64) -> Self {
        Self { stamp: self.stamp.plus_nanos(-(late_s * 1e9).round() as i64), late_sigma_s, ..self }
    }
    /// Velocity of a fix; `None` if the receiver reports no velocity.
    pub fn from_fix(row: &GnssRow) -> Option<Self> {
        let reported = |value: f64| (value >= 0.0).then_some(value);
        let hdop = Some(f64::from(row.hdop)).filter(|hdop| *hdop > 0.0);
        Self::new(Stamp(row.stamp), reported(row.speed_mps)?, reported(row.course_deg), hdop)
    }
    pub(crate) fn speed(&self) -> f64 {
        self.east_north[0].hypot(self.east_north[1])
    }
}

/// Means over the time between two samples, along the axes of the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InertialInterval {
    /// Duration, s.
    pub seconds: f64,
    /// Specific force, m/s^2.
    pub force: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
}

/// Mean measurement of an inertial unit, along the axes of the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InertialMean {
    /// Specific force, m/s^2.
    pub force: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
}

/// Samples and velocities in time order.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct SensorLog {
    samples: Vec<InertialSample>,
    velocities: Vec<GroundVelocity>,
}

impl SensorLog {
    pub fn push_inertial(&mut self, sample: InertialSample) {
        let is_later = self.samples.last().is_none_or(|last| last.stamp < sample.stamp);
        if is_later && sample.force.iter().chain(&sample.rate).all(|v| v.is_finite()) {
            self.samples.push(sample);
            let n_over = self.samples.len().saturating_sub(MAX_WAITING);
            self.samples.drain(..n_over);
        }
    }

    pub fn forget_inertial(&mut self) {
        self.samples.clear();
    }

    pub fn push_velocity(&mut self, velocity: GroundVelocity) {
        if self.velocities.last().is_none_or(|last| last.stamp < velocity.stamp) {
            self.velocities.push(velocity);
            let n_over = self.velocities.len().saturating_sub(MAX_WAITING);
            self.velocities.drain(..n_over);
        }
    }

    /// Whether samples cover the time from `begin` to `end` without a gap.
    pub fn covers(&self, begin: Stamp, end: Stamp) -> bool {
        let after = self.samples.partition_point(|sample| sample.stamp <= begin);
        let until = self.samples.partition_point(|sample| sample.stamp < end);
        let around = after.checked_sub(1).and_then(|before| self.samples.get(before..=until));
        let Some(around) = around else { return false };
        around.windows(2).all(|pair| pair[1].stamp.0 - pair[0].stamp.0 <= GAP_NANOS)
    }

    /// Means of consecutive samples with the time that each of them covers, from `begin` to `end`.
    pub fn between(&self, begin: Stamp, end: Stamp) -> impl Iterator<Item = InertialInterval> {
        let after = self.samples.partition_point(|sample| sample.stamp <= begin).saturating_sub(1);
        let pairs = self.samples[after..].windows(2).take_while(move |pair| pair[0].stamp < end);
        pairs.map(move |pair| {
            let from = pair[0].stamp.max(begin);
            let to = pair[1].stamp.min(end);
            InertialInterval {
                seconds: to.seconds_since(from),
                force: (pair[0].force + pair[1].force) * 0.5,
                rate: (pair[0].rate + pair[1].rate) * 0.5,
            }
        })
    }

    /// Mean force and rate from `begin` to `end`; `None` without samples.
    pub fn mean(&self, begin: Stamp, end: Stamp) -> Option<InertialMean> {
        let mut seconds = 0.0;
        let mut force = Vector3::zeros();
        let mut rate = Vector3::zeros();
        for interval in self.between(begin, end) {
            seconds += interval.seconds;
            force += interval.force * interval.seconds;
            rate += interval.rate * interval.seconds;
        }
        (seconds > 0.0).then(|| InertialMean { force: force / seconds, rate: rate / seconds })
    }

    /// Mean force and rate of the last half second before `end` if the samples show that the vehicle stands.
    pub fn standstill(&self, end: Stamp) -> Option<InertialMean> {
        let begin = end.plus_nanos(-STILL_NANOS);
        let mean = self.mean(begin, end).filter(|_| self.covers(begin, end))?;
        let after = self.samples.partition_point(|sample| sample.stamp < begin);
        let window: Vec<&InertialSample> = self.samples[after..].iter().take_while(|s| s.stamp <= end).collect();
        let mean_square =
            |of: &dyn Fn(&InertialSample) -> f64| window.iter().map(|s| of(s)).sum::<f64>() / window.len() as f64;
        let is_still = mean_square(&|s| (s.force - mean.force).norm_squared()) < STILL_MPS2 * STILL_MPS2
            && mean_square(&|s| (s.rate - mean.rate).norm_squared()) < STILL_RADPS * STILL_RADPS;
        is_still.then_some(mean)
    }

    /// Removes and returns the next velocity up to `end`.
    pub fn pop_velocity(&mut self, end: Stamp) -> Option<GroundVelocity> {
        let is_due = self.velocities.first().is_some_and(|velocity| velocity.stamp <= end);
        is_due.then(|| self.velocities.remove(0))
    }

    /// The latest velocity up to `end`.
    pub fn velocity_at(&self, end: Stamp) -> Option<&GroundVelocity> {
        self.velocities.iter().rfind(|velocity| velocity.stamp <= end)
    }

    /// Drops samples that are no longer needed after `stamp`.
    pub fn forget_before(&mut self, stamp: Stamp) {
        let keep_from = self.samples.partition_point(|sample| sample.stamp.0 < stamp.0 - KEPT_NANOS);
        self.samples.drain(..keep_from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(millis: i64, forward: f64) -> InertialSample {
        let force = Vector3::new(forward, 0.0, 9.81);
        InertialSample { stamp: Stamp(millis * 1_000_000), force, rate: Vector3::z() * forward }
    }

    fn log(samples: impl Iterator<Item = InertialSample>) -> SensorLog {
        let mut log = SensorLog::default();
        samples.for_each(|sample| log.push_inertial(sample));
        log
    }

    #[test]
    fn mean_of_a_ramp_is_its_middle_value_for_any_interval() {
        let ramp = log((0..100).map(|i| sample(i * 10, i as f64 * 0.01)));
        for (begin, end) in [(0, 500), (103, 217), (391, 397), (985, 990)] {
            let [begin, end] = [begin, end].map(|millis| Stamp(millis * 1_000_000));
            let seconds: f64 = ramp.between(begin, end).map(|interval| interval.seconds).sum();
            assert!((seconds - end.seconds_since(begin)).abs() < 1e-9);
            let middle = (begin.0 + end.0) as f64 * 0.5e-9;
            let InertialMean { force, rate } = ramp.mean(begin, end).expect("samples");
            assert!((force.x - middle).abs() < 5e-3 && (rate.z - force.x).abs() < 1e-12, "{force} {middle}");
        }
    }

    #[test]
    fn coverage_ends_at_gaps_and_at_the_last_sample() {
        let with_gap = log((0..100).filter(|i| !(40..50).contains(i)).map(|i| sample(i * 10, 0.0)));
        let covers = |begin: i64, end: i64| with_gap.covers(Stamp(begin * 1_000_000), Stamp(end * 1_000_000));
        assert!(covers(0, 390) && covers(505, 990) && covers(205, 206));
        assert!(!covers(300, 450) && !covers(450, 600) && !covers(900, 1000) && !covers(-10, 100));
        assert!(!SensorLog::default().covers(Stamp(0), Stamp(1)));
    }

    #[test]
    fn standstill_is_not_detected_while_the_vehicle_vibrates() {
        let at = Stamp(900_000_000);
        let vibrating = |by: f64| log((0..100).map(|i| sample(i * 10, if i % 2 == 0 { by } else { -by })));
        assert!(vibrating(0.01).standstill(at).is_some() && vibrating(0.2).standstill(at).is_none());
        assert!(SensorLog::default().standstill(at).is_none());
    }

    #[test]
    fn velocity_without_a_course_is_valid_only_near_standstill() {
        let at = Stamp(0);
        assert_eq!(GroundVelocity::new(at, 5.0, None, Some(1.0)), None);
        let moving = GroundVelocity::new(at, 5.0, Some(90.0), Some(2.0)).expect("a velocity");
        assert!((moving.east_north[0] - 5.0).abs() < 1e-12 && moving.east_north[1].abs() < 1e-12);
        assert!((moving.sigma - 0.2).abs() < 1e-12);
        let standing = GroundVelocity::new(at, 0.2, None, None).expect("it stands");
        assert!(standing.east_north == [0.0; 2] && standing.sigma > 0.2);
    }
}
