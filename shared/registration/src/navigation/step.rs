//! From one time to a later one, and from one step to the next.

use super::{ATTITUDE, FORCE_BIAS, N, Navigation, PLACE, RATE_BIAS, TURN, VELOCITY, symmetric};
use crate::sensors::SensorLog;
use geometry::{Stamp, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, SMatrix, SVector};

/// m/s^2, at 45 degrees of latitude. What it differs by elsewhere is a bias.
const GRAVITY_MPS2: f64 = 9.806;
/// Of an industrial inertial unit on a shaking vehicle: white noise per root of Hz (m/s^2 and rad/s; engine and road shake by
/// 0.1 m/s^2 at 100 Hz), and what biases gain in a root of a second.
const FORCE_NOISE: f64 = 0.01;
const RATE_NOISE: f64 = 3e-4;
const FORCE_BIAS_WALK: f64 = 2e-4;
const RATE_BIAS_WALK: f64 = 1e-5;

impl Navigation {
    /// From one time to the next.
    pub(super) fn go(&mut self, log: &SensorLog, is_felt: bool, [from, to]: [Stamp; 2], acceleration: (f64, f64)) {
        let seconds = to.seconds_since(from);
        if seconds <= 0.0 {
            return;
        }
        let mut change = SMatrix::<f64, N, N>::identity();
        let mut noise = SVector::<f64, N>::zeros();
        let mut set =
            |row: usize, col: usize, block: Matrix3<f64>| change.fixed_view_mut::<3, 3>(row, col).copy_from(&block);
        let mut add = |part: usize, sigma: f64| noise.fixed_rows_mut::<3>(part).fill(sigma * sigma);
        set(PLACE, VELOCITY, Matrix3::identity() * seconds);
        if is_felt {
            let (force, axes) = self.integrate(log, [from, to]);
            let falling = self.gravity().cross_matrix() * self.begin_from_level() * seconds;
            for (part, by) in [(VELOCITY, 1.0), (PLACE, seconds * 0.5)] {
                set(part, TURN, -force.cross_matrix() * by);
                set(part, ATTITUDE, falling * by);
                set(part, FORCE_BIAS, -axes * (seconds * by));
            }
            set(TURN, RATE_BIAS, -axes * seconds);
            let root = seconds.sqrt();
            add(VELOCITY, FORCE_NOISE * root);
            add(TURN, RATE_NOISE * root);
            add(RATE_BIAS, RATE_BIAS_WALK * root);
            add(FORCE_BIAS, FORCE_BIAS_WALK * root);
        } else {
            // The rate's error stands where the gyroscopes' bias does.
            let axes = self.coast(seconds);
            set(TURN, RATE_BIAS, -axes * seconds);
            add(VELOCITY, acceleration.0 * seconds);
            add(RATE_BIAS, acceleration.1 * seconds);
        }
        // What changes the velocity changes the place, too: noise comes at the begin, which makes it a little larger.
        let before = self.covariance + SMatrix::from_diagonal(&noise);
        self.covariance = change * before * change.transpose();
        self.shared *= change.transpose();
    }

    /// Goes on by samples. Force times time in the axes of the step's begin, and the body's mean axes there.
    fn integrate(&mut self, log: &SensorLog, [from, to]: [Stamp; 2]) -> (Vector3<f64>, Matrix3<f64>) {
        let gravity = self.gravity();
        let (begin, mut sum) = (self.turn, Vector3::zeros());
        for (seconds, force, rate) in log.between(from, to) {
            let half_turn = UnitQuaternion::from_scaled_axis((rate - self.rate_bias) * (seconds * 0.5));
            let half_way = self.turn * half_turn;
            let force = half_way * (force - self.force_bias);
            let gain = (force + gravity) * seconds;
            self.way += (self.velocity + gain * 0.5) * seconds;
            self.velocity += gain;
            self.turn = half_way * half_turn;
            sum += force * seconds;
        }
        (sum, begin.slerp(&self.turn, 0.5).to_rotation_matrix().into_inner())
    }

    /// Goes on as before. The body's mean axes in those of the step's begin.
    fn coast(&mut self, seconds: f64) -> Matrix3<f64> {
        let half_turn = UnitQuaternion::from_scaled_axis(self.last_rate * (seconds * 0.5));
        let half_way = self.turn * half_turn;
        // The velocity turns with the body.
        let mean_velocity = half_way * (self.turn.inverse() * self.velocity);
        self.way += mean_velocity * seconds;
        self.velocity = half_way * (half_turn * (self.turn.inverse() * self.velocity));
        self.turn = half_way * half_turn;
        half_way.to_rotation_matrix().into_inner()
    }

    /// The end of the step is the begin of the next one.
    pub(super) fn turn_to_end(&mut self) {
        let end_from_begin = self.turn.inverse().to_rotation_matrix();
        let mut change = SMatrix::<f64, N, N>::identity();
        let mut set =
            |row: usize, col: usize, block: &Matrix3<f64>| change.fixed_view_mut::<3, 3>(row, col).copy_from(block);
        set(PLACE, PLACE, &Matrix3::zeros());
        set(TURN, TURN, &Matrix3::zeros());
        set(VELOCITY, VELOCITY, end_from_begin.matrix());
        set(VELOCITY, TURN, &(end_from_begin.matrix() * self.velocity.cross_matrix()));
        set(ATTITUDE, TURN, self.level_from_begin.to_rotation_matrix().matrix());
        self.covariance = symmetric(&(change * self.covariance * change.transpose()));
        self.shared *= change.transpose();
        self.velocity = end_from_begin * self.velocity;
        self.level_from_begin *= self.turn;
        self.level_from_begin.renormalize();
        (self.way, self.turn) = (Vector3::zeros(), UnitQuaternion::identity());
    }

    fn begin_from_level(&self) -> Matrix3<f64> {
        self.level_from_begin.inverse().to_rotation_matrix().into_inner()
    }

    /// Axes of the step's begin, m/s^2.
    pub(super) fn gravity(&self) -> Vector3<f64> {
        self.level_from_begin.inverse() * Vector3::new(0.0, 0.0, -GRAVITY_MPS2)
    }
}
