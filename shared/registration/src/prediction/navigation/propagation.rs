//! Propagation of the filter over time, and the change to the frame of the next step.

use super::{ATTITUDE, FORCE_BIAS, N, Navigation, POSITION, RATE_BIAS, ROTATION, VELOCITY, symmetric};
use crate::Acceleration;
use crate::prediction::sensors::{InertialInterval, SensorLog};
use geometry::{Stamp, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, SMatrix, SVector};

/// Gravity at 45 degrees of latitude, m/s^2. The difference elsewhere is estimated as a bias.
const GRAVITY_MPS2: f64 = 9.806;
/// Noise of an industrial inertial unit on a vibrating vehicle: white noise per root of Hz (m/s^2 and rad/s; engine and
/// road vibrate by 0.1 m/s^2 at 100 Hz), and random walk of the biases per root of a second.
const FORCE_NOISE: f64 = 0.01;
const RATE_NOISE: f64 = 3e-4;
const FORCE_BIAS_WALK: f64 = 2e-4;
const RATE_BIAS_WALK: f64 = 1e-5;

/// Integral over inertial samples.
struct InertialIntegral {
    /// Integral of the specific force, m/s, in the axes at the start of the step.
    force_integral: Vector3<f64>,
    /// Mean axes of the body during the step, in the axes at its start.
    axes: Matrix3<f64>,
}

/// Time constant with which an unmeasured rotation decays to straight motion, s.
const STRAIGHTENING_S: f64 = 1.0;

/// The share of an angular rate that remains after `seconds` without measurement. Vehicles turn for seconds, not for
/// minutes: a rate that continues forever would turn the noise of a standstill on a bare road into a spin.
pub(crate) fn straightening(seconds: f64) -> f64 {
    (-seconds / STRAIGHTENING_S).exp()
}

impl Navigation {
    /// Propagates state and covariance from one time to the next, with inertial samples if the log `has_samples`.
    pub(super) fn propagate(
        &mut self,
        log: &SensorLog,
        has_samples: bool,
        [from, to]: [Stamp; 2],
        acceleration: Acceleration,
    ) {
        let seconds = to.seconds_since(from);
        if seconds <= 0.0 {
            return;
        }
        let mut transition = SMatrix::<f64, N, N>::identity();
        let mut noise = SVector::<f64, N>::zeros();
        let mut set =
            |row: usize, col: usize, block: Matrix3<f64>| transition.fixed_view_mut::<3, 3>(row, col).copy_from(&block);
        let mut add = |part: usize, sigma: f64| noise.fixed_rows_mut::<3>(part).fill(sigma * sigma);
        set(POSITION, VELOCITY, Matrix3::identity() * seconds);
        if has_samples {
            let InertialIntegral { force_integral: force, axes } = self.integrate(log, [from, to]);
            let gravity = self.gravity().cross_matrix() * self.begin_from_level() * seconds;
            for (part, by) in [(VELOCITY, 1.0), (POSITION, seconds * 0.5)] {
                set(part, ROTATION, -force.cross_matrix() * by);
                set(part, ATTITUDE, gravity * by);
                set(part, FORCE_BIAS, -axes * (seconds * by));
            }
            set(ROTATION, RATE_BIAS, -axes * seconds);
            let root = seconds.sqrt();
            add(VELOCITY, FORCE_NOISE * root);
            add(ROTATION, RATE_NOISE * root);
            add(RATE_BIAS, RATE_BIAS_WALK * root);
            add(FORCE_BIAS, FORCE_BIAS_WALK * root);
        } else {
            // The error of the angular rate replaces the gyroscope bias.
            let axes = self.coast(seconds);
            set(ROTATION, RATE_BIAS, -axes * seconds);
            set(RATE_BIAS, RATE_BIAS, Matrix3::identity() * straightening(seconds));
            add(VELOCITY, acceleration.linear_mps2 * seconds);
            add(RATE_BIAS, acceleration.angular_radps2 * seconds);
        }
        // Noise is added at the start of the interval, which slightly overestimates its effect on the position.
        let before = self.covariance + SMatrix::from_diagonal(&noise);
        self.covariance = transition * before * transition.transpose();
        self.cross_covariance *= transition.transpose();
    }

    /// Integrates inertial samples.
    fn integrate(&mut self, log: &SensorLog, [from, to]: [Stamp; 2]) -> InertialIntegral {
        let gravity = self.gravity();
        let begin = self.rotation;
        let mut integral = Vector3::zeros();
        for InertialInterval { seconds, force, rate } in log.between(from, to) {
            let half_rotation = UnitQuaternion::from_scaled_axis((rate - self.rate_bias) * (seconds * 0.5));
            let half_way = self.rotation * half_rotation;
            let force = half_way * (force - self.force_bias);
            let gain = (force + gravity) * seconds;
            self.displacement += (self.velocity + gain * 0.5) * seconds;
            self.velocity += gain;
            self.rotation = half_way * half_rotation;
            integral += force * seconds;
        }
        let axes = begin.slerp(&self.rotation, 0.5).to_rotation_matrix().into_inner();
        InertialIntegral { force_integral: integral, axes }
    }

    /// Continues at constant velocity. Returns the mean axes of the body relative to the axes at the start of the step.
    fn coast(&mut self, seconds: f64) -> Matrix3<f64> {
        let half_rotation = UnitQuaternion::from_scaled_axis(self.last_rate * (seconds * 0.5));
        let half_way = self.rotation * half_rotation;
        // The velocity rotates with the body.
        let mean_velocity = half_way * (self.rotation.inverse() * self.velocity);
        self.displacement += mean_velocity * seconds;
        self.velocity = half_way * (half_rotation * (self.rotation.inverse() * self.velocity));
        self.rotation = half_way * half_rotation;
        half_way.to_rotation_matrix().into_inner()
    }

    /// Changes to the frame of the next step, which starts at the end of this one.
    pub(super) fn begin_next_step(&mut self) {
        let end_from_begin = self.rotation.inverse().to_rotation_matrix();
        let mut transition = SMatrix::<f64, N, N>::identity();
        let mut set =
            |row: usize, col: usize, block: &Matrix3<f64>| transition.fixed_view_mut::<3, 3>(row, col).copy_from(block);
        set(POSITION, POSITION, &Matrix3::zeros());
        set(ROTATION, ROTATION, &Matrix3::zeros());
        set(VELOCITY, VELOCITY, end_from_begin.matrix());
        set(VELOCITY, ROTATION, &(end_from_begin.matrix() * self.velocity.cross_matrix()));
        set(ATTITUDE, ROTATION, self.level_from_begin.to_rotation_matrix().matrix());
        self.covariance = symmetric(&(transition * self.covariance * transition.transpose()));
        self.cross_covariance *= transition.transpose();
        self.velocity = end_from_begin * self.velocity;
        self.level_from_begin *= self.rotation;
        self.level_from_begin.renormalize();
        self.displacement = Vector3::zeros();
        self.rotation = UnitQuaternion::identity();
    }

    fn begin_from_level(&self) -> Matrix3<f64> {
        self.level_from_begin.inverse().to_rotation_matrix().into_inner()
    }

    /// Gravity in the axes at the start of the step, m/s^2.
    pub(super) fn gravity(&self) -> Vector3<f64> {
        self.level_from_begin.inverse() * Vector3::new(0.0, 0.0, -GRAVITY_MPS2)
    }
}
