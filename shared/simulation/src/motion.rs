//! The recording vehicle's way: how far it is at a time, and its pose there.
//!
//! All closed forms with continuous derivatives, so that inertial samples can be taken from them exactly.

use crate::scene::Street;
use geometry::{Pose, Stamp};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Where along the street the vehicle starts, m.
const START_X: f64 = 40.0;
/// Lower bound of the speed once it rolls, m/s.
const CRUISE_MPS: f64 = 8.2;
/// Time scale of starting, s: 2.1 m/s^2 at most.
const START_SECONDS: f64 = 2.5;
/// The speed swells by this much, m/s.
const SWELL_MPS: f64 = 1.8;
/// In this rhythm, rad/s.
const SWELL_RATE: f64 = 0.7;

/// How the vehicle's x grows: from rest to 8 to 10 m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Shifts the rhythm of the speed, rad.
    pub phase: f64,
}

impl Progress {
    /// x of the vehicle, `seconds` after the begin.
    pub fn x(&self, seconds: f64) -> f64 {
        // Speed c s^2 / (s^2 + T^2) from rest, plus a swell that begins at zero with zero slope.
        let s = seconds;
        let start = CRUISE_MPS * (s - START_SECONDS * (s / START_SECONDS).atan());
        let swell = 0.5 * SWELL_MPS * (s - (SWELL_RATE * s).sin() / SWELL_RATE);
        START_X + start + swell
    }
}

/// The vehicle's motion.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The date of second 0.
    pub begin: Stamp,
    progress: Progress,
    street: Street,
    lane_t: f64,
    body_height_m: f64,
}

impl Motion {
    /// Along a lane of the street, with the body frame 1 m above the road.
    pub fn new(begin: Stamp, progress: Progress, street: Street, lane_t: f64) -> Self {
        Self { begin, progress, street, lane_t, body_height_m: 1.0 }
    }
    /// The same with the body frame at another height above the road, m.
    #[must_use]
    pub fn with_body_height(self, body_height_m: f64) -> Self {
        Self { body_height_m, ..self }
    }
    /// `world_from_body`, `seconds` after the begin.
    pub fn pose(&self, seconds: f64) -> Pose {
        let x = self.progress.x(seconds);
        // The vehicle keeps its lane within 10 cm and rocks on its springs: 1 cm, a quarter of a degree.
        let phase = self.progress.phase;
        let t = self.lane_t + 0.1 * (0.09 * x + phase).sin();
        let bounce = 0.01 * (0.8 * x + phase).sin();
        let roll = 0.004 * (0.55 * x).sin();
        let pitch = 0.004 * (0.65 * x + 1.0).sin();
        let wander = (0.009 * (0.09 * x + phase).cos()).atan();
        let frame = self.street.frame(x, t, 0.0, wander);
        let rock = UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
        frame * Isometry3::from_parts(Vector3::new(0.0, 0.0, self.body_height_m + bounce).into(), rock)
    }
    /// `world_from_body` at a stamp.
    pub fn pose_at(&self, stamp: Stamp) -> Pose {
        self.pose(stamp.seconds_since(self.begin))
    }
    /// Velocity in the world, m/s.
    pub fn velocity(&self, seconds: f64) -> Vector3<f64> {
        let h = 1e-4;
        (self.pose(seconds + h).translation.vector - self.pose(seconds - h).translation.vector) / (2.0 * h)
    }
    /// Acceleration in the world, m/s^2.
    pub fn acceleration(&self, seconds: f64) -> Vector3<f64> {
        // 1 ms: truncation and rounding of the second difference are both below 1e-5 m/s^2.
        let h = 1e-3;
        let at = |s: f64| self.pose(s).translation.vector;
        (at(seconds + h) - 2.0 * at(seconds) + at(seconds - h)) / (h * h)
    }
    /// Angular rate in the body frame, rad/s.
    pub fn angular_rate(&self, seconds: f64) -> Vector3<f64> {
        let h = 1e-4;
        let (before, after) = (self.pose(seconds - h).rotation, self.pose(seconds + h).rotation);
        (before.inverse() * after).scaled_axis() / (2.0 * h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion() -> Motion {
        Motion::new(Stamp(1_000_000_000), Progress { phase: 0.4 }, Street::new(300.0, 0.2), -1.6)
    }

    #[test]
    fn the_vehicle_starts_from_rest_and_reaches_its_speed() {
        let motion = motion();
        assert!(motion.velocity(0.0).norm() < 1e-3);
        for i in 0..40 {
            let seconds = 8.0 + f64::from(i) * 0.5;
            let speed = motion.velocity(seconds).norm();
            assert!((7.0..10.6).contains(&speed), "{speed} m/s after {seconds} s");
            assert!(motion.acceleration(seconds).norm() < 3.0);
        }
    }

    #[test]
    fn inertial_samples_integrate_to_the_motion() {
        let motion = motion();
        let dt = 0.002;
        let mut rotation = motion.pose(2.0).rotation;
        let (mut position, mut velocity) = (motion.pose(2.0).translation.vector, motion.velocity(2.0));
        for i in 0..1500 {
            let middle = 2.0 + (f64::from(i) + 0.5) * dt;
            rotation *= UnitQuaternion::from_scaled_axis(motion.angular_rate(middle) * dt);
            position += (velocity + motion.acceleration(middle) * (0.5 * dt)) * dt;
            velocity += motion.acceleration(middle) * dt;
        }
        let end = motion.pose(5.0);
        assert!((position - end.translation.vector).norm() < 0.002);
        assert!(rotation.angle_to(&end.rotation) < 1e-4);
    }
}
