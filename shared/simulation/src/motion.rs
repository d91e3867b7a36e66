//! Motion of the ego vehicle: its pose over time.
//!
//! Path and speed profile have continuous derivatives, so that inertial samples are exact.

use geometry::{Pose, Stamp};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::sync::Arc;
use town::{FAST_MPS, GroundPath, SpeedProfile};

/// Motion of the ego vehicle.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Stamp of second 0.
    pub begin: Stamp,
    path: Arc<GroundPath>,
    speed: Arc<SpeedProfile>,
    /// Phase of the lane wander and the suspension, rad.
    phase: f64,
    body_height_m: f64,
    /// Waves of the suspension per metre, relative to low speed.
    waves: f64,
}

impl Motion {
    /// Motion along a path, with the body frame 1 m above the road. `phase` (rad) varies lane wander and suspension.
    pub const fn new(begin: Stamp, path: Arc<GroundPath>, speed: Arc<SpeedProfile>, phase: f64) -> Self {
        Self { begin, path, speed, phase, body_height_m: 1.0, waves: 1.0 }
    }
    /// This motion with the body frame at another height above the road, m.
    #[must_use]
    pub fn with_body_height(self, body_height_m: f64) -> Self {
        Self { body_height_m, ..self }
    }
    /// This motion for another cruise speed, m/s: from [`FAST_MPS`] on, the suspension rocks in longer waves, 1.7 times a
    /// second.
    #[must_use]
    pub fn with_cruise(self, cruise_mps: f64) -> Self {
        Self { waves: (FAST_MPS / cruise_mps).min(1.0), ..self }
    }
    /// Distance along the path, m.
    pub fn distance_m(&self, seconds: f64) -> f64 {
        self.speed.distance_m(seconds)
    }
    /// `world_from_body`, `seconds` after the start.
    pub fn pose(&self, seconds: f64) -> Pose {
        let x = self.distance_m(seconds);
        // The vehicle stays within 10 cm of its lane center and rocks on its suspension: 1 cm, a quarter of a degree.
        let left = 0.1 * (0.09 * x + self.phase).sin();
        let along = self.waves * x;
        let bounce = 0.01 * (0.8 * along + self.phase).sin();
        let roll = 0.004 * (0.55 * along).sin();
        let pitch = 0.004 * (0.65 * along + 1.0).sin();
        let wander = (0.009 * (0.09 * x + self.phase).cos()).atan();
        let rock = UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
        let height = Vector3::new(0.0, 0.0, self.body_height_m + bounce);
        self.path.frame(x, left, wander) * Isometry3::from_parts(height.into(), rock)
    }
    /// `world_from_body` at a stamp.
    pub fn pose_at(&self, stamp: Stamp) -> Pose {
        self.pose(stamp.seconds_since(self.begin))
    }
    /// Velocity of the body origin in the world, m/s.
    pub fn velocity(&self, seconds: f64) -> Vector3<f64> {
        self.velocity_of(&Point3::origin(), seconds)
    }
    /// Velocity of a point of the body in the world, m/s.
    pub fn velocity_of(&self, point_in_body: &Point3<f64>, seconds: f64) -> Vector3<f64> {
        let h = 1e-4;
        (self.pose(seconds + h) * point_in_body - self.pose(seconds - h) * point_in_body) / (2.0 * h)
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
        let before = self.pose(seconds - h).rotation;
        let after = self.pose(seconds + h).rotation;
        (before.inverse() * after).scaled_axis() / (2.0 * h)
    }
}

/// A drive of `seconds` on a loop of 1 km with four turns over hills, for tests.
#[cfg(test)]
pub fn example(begin: Stamp, seconds: f64) -> Motion {
    use town::{Driver, Terrain};
    let corners = [[0.0, 0.0], [300.0, 0.0], [300.0, 200.0], [0.0, 200.0]].map(nalgebra::Vector2::from);
    let path = GroundPath::around(&corners, 4.0, Terrain::new(11)).expect("four corners");
    let driver = Driver { cruise_mps: 9.0, phase: 0.4, stops: Vec::new() };
    let speed = SpeedProfile::from_rest(&path, &driver, 40.0, seconds);
    Motion::new(begin, Arc::new(path), Arc::new(speed), 0.4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vehicle_starts_from_rest_and_reaches_cruise_speed() {
        let motion = example(Stamp(1_000_000_000), 40.0);
        assert!(motion.velocity(0.0).norm() < 1e-3);
        for i in 0..40 {
            let seconds = 8.0 + f64::from(i) * 0.5;
            let speed = motion.velocity(seconds).norm();
            assert!((7.0..10.6).contains(&speed), "{speed} m/s after {seconds} s");
            assert!(motion.acceleration(seconds).norm() < 3.0);
        }
    }

    #[test]
    fn integrated_motion_derivatives_give_the_pose() {
        let motion = example(Stamp(1_000_000_000), 40.0);
        // At 34 s it is in its first turn.
        for begin in [2.0, 31.0] {
            let dt = 0.002;
            let mut rotation = motion.pose(begin).rotation;
            let mut position = motion.pose(begin).translation.vector;
            let mut velocity = motion.velocity(begin);
            for i in 0..2500 {
                let middle = begin + (f64::from(i) + 0.5) * dt;
                rotation *= UnitQuaternion::from_scaled_axis(motion.angular_rate(middle) * dt);
                position += (velocity + motion.acceleration(middle) * (0.5 * dt)) * dt;
                velocity += motion.acceleration(middle) * dt;
            }
            let end = motion.pose(begin + 5.0);
            assert!((position - end.translation.vector).norm() < 0.004, "{}", position - end.translation.vector);
            assert!(rotation.angle_to(&end.rotation) < 1e-4);
        }
        assert!(motion.pose(31.0).rotation.angle_to(&motion.pose(36.0).rotation) > 0.7, "there is a turn");
    }

    #[test]
    fn lever_arm_adds_velocity_in_a_turn() {
        let motion = example(Stamp(1_000_000_000), 40.0);
        let place = Point3::new(-1.2, 0.3, 1.75);
        let swing = motion.pose(34.0).rotation * motion.angular_rate(34.0).cross(&place.coords);
        let apart = motion.velocity_of(&place, 34.0) - motion.velocity(34.0);
        assert!(swing.norm() > 0.1 && (apart - swing).norm() < 1e-4, "{apart} {swing}");
    }
}
