//! Predicts the motion between sweeps from inertial samples and GNSS velocities, and tracks the covariance of the pose: an
//! error-state Kalman filter.
//!
//! The filter is robocentric (Huai and Huang, IROS 2018; with a LiDAR: Qin et al., LINS, ICRA 2020): its state is in
//! the axes of the body at the previous sweep. Inertial samples predict the step from there, GNSS velocities and the
//! match correct it, and the end of the step becomes the start of the next one. Without samples the velocity stays
//! constant and its covariance grows.
//!
//! The error of the pose since the first sweep is a Schmidt state: the filter tracks its covariance and its correlation with the
//! other errors, but a match corrects only the step, not the accumulated error.

mod lidar_step;
mod propagation;
mod velocity;

use crate::prediction::sensors::{InertialMean, SensorLog};
use crate::{Acceleration, SensorMounting};
use geometry::{Pose, Stamp, UnitQuaternion, Vector3};
use lidar_step::LidarStep;
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector6};
pub(crate) use propagation::straightening;
use serde::{Deserialize, Serialize};

/// Error states, three numbers each: position and rotation since the previous sweep and velocity (axes of the body then), attitude
/// (level axes), biases of gyroscopes and accelerometers.
const N: usize = 18;
const POSITION: usize = 0;
const ROTATION: usize = 3;
const VELOCITY: usize = 6;
const ATTITUDE: usize = 9;
const RATE_BIAS: usize = 12;
const FORCE_BIAS: usize = 15;

/// Turn-on biases of an industrial inertial unit, m/s^2 and rad/s.
const FORCE_BIAS_SIGMA: f64 = 0.05;
const RATE_BIAS_SIGMA: f64 = 0.005;
/// Standard deviation of the velocity at the first sweep, along the forward, left and up axes, m/s: a vehicle in
/// traffic.
const FIRST_SPEED: [f64; 3] = [15.0, 1.0, 1.0];
const FIRST_RATE: f64 = 0.5;
/// Standard deviation of the velocity at the first sweep if a receiver measured it, m/s.
const MEASURED_SPEED: f64 = 0.5;
/// Angle between the first specific force and the vertical, rad: braking by 1 m/s^2.
const FIRST_TILT: f64 = 0.1;
/// Jitter of matched poses, which is not motion.
const POSE_NOISE_M: f64 = 5e-3;
const POSE_NOISE_RAD: f64 = 5e-4;
/// Number of sweeps that share the gyroscope bias error. The bias, which is common to all steps, shifts each sweep in
/// the same direction, and the map stays: half of its 60 sweeps measure the bias together. Without inertial samples
/// steps have little in common.
const COMMON_SWEEPS: f64 = 30.0;
/// Largest speed (m/s) and acceleration (m/s^2) of a possible standstill; the velocity of a detected standstill has
/// this standard deviation, m/s.
const SLOW_MPS: f64 = 0.3;
const STANDING_MPS2: f64 = 0.15;
const STANDING_MPS: f64 = 0.02;
/// Error of the gyroscope bias that is taken from the mean angular rate of half a second at rest, rad/s: noise, and
/// steps of the passengers. A difference larger than [`RATE_BIAS_GATE`] standard deviations is a rotation.
const STANDING_RADPS: f64 = 1e-3;
const RATE_BIAS_GATE: f64 = 4.0;
/// Largest grade of a road.
const GRADE: f64 = 0.1;
/// Distance after which the grade changes, m.
const HILL_M: f64 = 50.0;
/// Time for which a GNSS velocity supports predictions, s.
const VELOCITY_VALID_S: f64 = 2.0;
/// Time for which velocities are kept for late measurements, s.
const RECENT_S: f64 = 1.5;

/// Sensors that predicted a step. Without any sensor, the previous motion continues.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PredictionSources {
    /// Inertial samples.
    pub inertial: bool,
    /// Velocities of a GNSS receiver within the last two seconds.
    pub receiver: bool,
}

impl PredictionSources {
    pub(crate) fn is_any(self) -> bool {
        self.inertial || self.receiver
    }
}

/// State of the filter; part of the odometry's saved state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Navigation {
    /// Displacement of the inertial unit and rotation of the body in this step, axes of the body at its start.
    displacement: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    /// Velocity of the inertial unit, same axes.
    velocity: Vector3<f64>,
    /// Axes: z up; x points east if `north_is_known`.
    level_from_begin: UnitQuaternion<f64>,
    north_is_known: bool,
    rate_bias: Vector3<f64>,
    force_bias: Vector3<f64>,
    /// Angular rate of the body at the start of the step, rad/s.
    last_rate: Vector3<f64>,
    last_velocity: Option<Stamp>,
    n_rejected: u32,
    /// Velocities at the starts of the last steps, level axes.
    recent_velocities: Vec<LevelVelocity>,
    covariance: SMatrix<f64, N, N>,
    /// Covariance of the pose since the first sweep: translation, rotation, odom axes about the LiDAR.
    pose: Matrix6<f64>,
    /// Cross-covariance between the pose errors and the filter errors.
    cross_covariance: SMatrix<f64, 6, N>,
}

/// Velocity of the inertial unit at a time, level axes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct LevelVelocity {
    stamp: Stamp,
    velocity: Vector3<f64>,
}

/// Predicted pose of the LiDAR.
pub(crate) struct PredictedPose {
    pub mid: Pose,
    /// Inverse covariance of the pose in the map; zero if no sensor supports the prediction.
    pub information: Matrix6<f64>,
    pub sources: PredictionSources,
}

impl PredictedPose {
    /// The pose `result` of a match with the weight of this prediction, without it. `information`: inverse covariance of the match
    /// alone, in the units of the prediction's.
    pub fn removed_from(&self, result: &Pose, information: &Matrix6<f64>) -> Pose {
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(result.translation.vector - self.mid.translation.vector));
        residual.fixed_rows_mut::<3>(3).copy_from(&(result.rotation * self.mid.rotation.inverse()).scaled_axis());
        // A direction without information keeps the result.
        let regular = information + diagonal(1.0, 1e2);
        let step = regular.cholesky().map_or_else(Vector6::zeros, |found| found.solve(&(self.information * residual)));
        let rotation = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        Pose::from_parts((result.translation.vector + step.fixed_rows::<3>(0)).into(), rotation * result.rotation)
    }
}

/// Measurement of a step by a match, as inverse covariances.
pub(crate) struct StepMeasurement {
    /// Inverse covariance of the pose in the map; zero along degenerate directions.
    pub information: Matrix6<f64>,
    /// Inverse covariance with the residual error that accumulates over a drive.
    pub drift_information: Matrix6<f64>,
}

impl Navigation {
    /// Starts the filter at the middle of the first sweep. `velocity` is the body's velocity in body axes;
    /// `is_measured`: by a receiver.
    pub fn begin(velocity: &Vector3<f64>, is_measured: bool, log: &SensorLog, [begin, end]: [Stamp; 2]) -> Self {
        let inertial = log.mean(begin, end).filter(|_| log.covers(begin, end));
        let up = inertial.map_or_else(Vector3::z, |mean| mean.force);
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let rate_bias = if inertial.is_some() { RATE_BIAS_SIGMA } else { FIRST_RATE };
        for axis in 0..3 {
            let speed = if is_measured { MEASURED_SPEED } else { FIRST_SPEED[axis] };
            // The heading has no error until north is known.
            let tilt = if axis < 2 { FIRST_TILT } else { 0.0 };
            let of: [(usize, f64); 4] =
                [(VELOCITY, speed), (ATTITUDE, tilt), (RATE_BIAS, rate_bias), (FORCE_BIAS, FORCE_BIAS_SIGMA)];
            for (part, sigma) in of {
                covariance[(part + axis, part + axis)] = sigma * sigma;
            }
        }
        Self {
            displacement: Vector3::zeros(),
            rotation: UnitQuaternion::identity(),
            velocity: *velocity,
            level_from_begin: UnitQuaternion::rotation_between(&up, &Vector3::z()).unwrap_or_default(),
            north_is_known: false,
            rate_bias: Vector3::zeros(),
            force_bias: Vector3::zeros(),
            last_rate: Vector3::zeros(),
            last_velocity: None,
            n_rejected: 0,
            recent_velocities: Vec::new(),
            covariance,
            pose: Matrix6::zeros(),
            cross_covariance: SMatrix::zeros(),
        }
    }

    /// Restarts the filter from the LiDAR's pose and velocity (its axes), because the inertial samples were wrong.
    pub fn forget_inertial(&mut self, body_from_lidar: &Pose, odom_from_lidar: &Pose, velocity: &Vector3<f64>) {
        self.velocity = body_from_lidar.rotation * velocity;
        self.level_from_begin = odom_from_lidar.rotation * body_from_lidar.rotation.inverse();
        self.north_is_known = false;
        self.recent_velocities.clear();
        self.rate_bias = Vector3::zeros();
        self.force_bias = Vector3::zeros();
        let parts: [(usize, [f64; 3]); 4] = [
            (VELOCITY, [MEASURED_SPEED; 3]),
            (ATTITUDE, [FIRST_TILT, FIRST_TILT, 0.0]),
            (RATE_BIAS, [RATE_BIAS_SIGMA; 3]),
            (FORCE_BIAS, [FORCE_BIAS_SIGMA; 3]),
        ];
        for (part, sigmas) in parts {
            self.covariance.fixed_rows_mut::<3>(part).fill(0.0);
            self.covariance.fixed_columns_mut::<3>(part).fill(0.0);
            self.cross_covariance.fixed_columns_mut::<3>(part).fill(0.0);
            for (axis, sigma) in sigmas.into_iter().enumerate() {
                self.covariance[(part + axis, part + axis)] = sigma * sigma;
            }
        }
    }

    /// Covariance of the pose: translation (m), then rotation (rad), odom axes about the LiDAR. A match measures height
    /// and inclination relative to the ground, not the absolute ones. An error of the horizontal position therefore
    /// adds to the height by the grade of a road, and to the inclination by the curvature of hills. (On a field the
    /// height of a vehicle that appeared to stand had a standard deviation of 30 cm and an error of 3 m.)
    pub fn pose_covariance(&self) -> Matrix6<f64> {
        let mut pose = self.pose;
        let horizontal = pose[(0, 0)] + pose[(1, 1)];
        pose[(2, 2)] += GRADE * GRADE * horizontal;
        for axis in [3, 4] {
            pose[(axis, axis)] += GRADE * GRADE * horizontal / (horizontal + HILL_M * HILL_M);
        }
        pose
    }

    /// Predicts the LiDAR's pose at `end` from its pose `from` at `begin`. `acceleration` is the process noise without
    /// inertial samples, `last_rate` the angular rate of the LiDAR at `begin` (its axes, rad/s).
    pub fn predict(
        &mut self,
        log: &mut SensorLog,
        mounting: &SensorMounting,
        from: &Pose,
        [begin, end]: [Stamp; 2],
        acceleration: Acceleration,
        last_rate: &Vector3<f64>,
    ) -> PredictedPose {
        self.last_rate = mounting.body_from_lidar.rotation * last_rate;
        let has_samples = log.covers(begin, end);
        self.remember_velocity(begin);
        let mut at = begin;
        while let Some(measured) = log.pop_velocity(end) {
            let until = measured.stamp.max(at);
            self.propagate(log, has_samples, [at, until], acceleration);
            self.update_velocity(&measured, until, log, mounting);
            at = until;
        }
        self.propagate(log, has_samples, [at, end], acceleration);
        log.forget_before(begin);
        let receiver = self.last_velocity.is_some_and(|last| end.seconds_since(last) < VELOCITY_VALID_S);
        let sources = PredictionSources { inertial: has_samples, receiver };
        let lidar = LidarStep::new(mounting, from, &self.rotation);
        let information = if sources.inertial {
            let jitter = diagonal(POSE_NOISE_M * POSE_NOISE_M, POSE_NOISE_RAD * POSE_NOISE_RAD);
            inverse(&(lidar.covariance(&self.covariance) + jitter))
        } else {
            Matrix6::zeros()
        };
        PredictedPose { mid: lidar.pose(&self.displacement, &self.rotation), information, sources }
    }

    /// Variance of the predicted position of the LiDAR along a unit vector (odom axes), m^2. `from` is its pose at the
    /// start of the step.
    pub fn step_variance(&self, mounting: &SensorMounting, from: &Pose, direction: &Vector3<f64>) -> f64 {
        let covariance = LidarStep::new(mounting, from, &self.rotation).covariance(&self.covariance);
        direction.dot(&(covariance.fixed_view::<3, 3>(0, 0) * direction))
    }

    /// Keeps the velocity at the start of a step.
    fn remember_velocity(&mut self, stamp: Stamp) {
        self.recent_velocities.retain(|recent| stamp.seconds_since(recent.stamp) < RECENT_S);
        self.recent_velocities.push(LevelVelocity { stamp, velocity: self.level_from_begin * self.velocity });
    }

    /// Adds a pose error, given as covariance (m, then rad), odom axes.
    pub fn add_error(&mut self, covariance: &Matrix6<f64>) {
        self.pose += covariance;
    }

    /// Updates the filter with the step from the LiDAR's pose `from` to `to`. `prediction` is the start of the match
    /// and `measurement` its result, `None` without a match.
    pub fn update_step(
        &mut self,
        mounting: &SensorMounting,
        [from, to]: [&Pose; 2],
        prediction: &PredictedPose,
        measurement: Option<&StepMeasurement>,
    ) {
        let lidar = LidarStep::new(mounting, from, &self.rotation);
        let h = lidar.jacobian;
        let step = lidar.covariance(&self.covariance);
        let [information, drift] = measurement.map_or_else(
            || [Matrix6::zeros(); 2],
            // Both poses of the step jitter.
            |measurement| [measurement.information * 0.5, measurement.drift_information],
        );
        // The remaining error of the step, of the part common to all steps, and the filter errors after the update.
        let remaining = (Matrix6::identity() + step * drift).try_inverse().unwrap_or_else(Matrix6::identity);
        let n_common = if prediction.sources.inertial { COMMON_SWEEPS } else { 1.0 };
        let remaining_common =
            (Matrix6::identity() + step * drift * n_common).try_inverse().unwrap_or_else(Matrix6::identity);
        let damping = (Matrix6::identity() + information * step).try_inverse().unwrap_or_else(Matrix6::zeros);
        let gain = self.covariance * h.transpose() * damping;
        let gain_information = gain * information;
        let after = self.covariance - gain_information * h * self.covariance;
        let cross_step = self.cross_covariance * h.transpose();
        let displacement = to.translation.vector - from.translation.vector;
        let lever = lever(&displacement);
        let mixed = lever * cross_step * remaining_common.transpose();
        self.pose = symmetric(&(lever * self.pose * lever.transpose() + mixed + mixed.transpose() + remaining * step));
        self.cross_covariance =
            lever * (self.cross_covariance - cross_step * gain_information.transpose()) + remaining_common * h * after;
        self.covariance = after;
        let predicted = lidar.pose(&self.displacement, &self.rotation);
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(to.translation.vector - predicted.translation.vector));
        residual.fixed_rows_mut::<3>(3).copy_from(&(to.rotation * predicted.rotation.inverse()).scaled_axis());
        // The matched pose lies between the prediction and the result of the match alone: add the part suppressed by
        // the prediction.
        let regularization = diagonal(1.0, 1e2);
        let inverse = (information + regularization).try_inverse().unwrap_or_else(Matrix6::zeros);
        let held_back = inverse * prediction.information * residual * 0.5;
        self.correct(&(gain * (information * (residual + held_back))), prediction.sources.inertial);
        self.begin_next_step();
    }

    /// Sets the velocity to zero if the inertial samples and the estimated velocity agree that the vehicle stands. Then
    /// the angular rates are the gyroscope bias.
    pub fn update_standstill(&mut self, log: &SensorLog, at: Stamp) {
        let is_gravity_alone = |force: Vector3<f64>| (force - self.force_bias + self.gravity()).norm() < STANDING_MPS2;
        let still = log.standstill(at).filter(|mean| self.velocity.norm() < SLOW_MPS && is_gravity_alone(mean.force));
        let Some(InertialMean { rate, .. }) = still else { return };
        let measure = |part: usize| {
            let mut h = SMatrix::<f64, 3, N>::zeros();
            h.fixed_view_mut::<3, 3>(0, part).copy_from(&Matrix3::identity());
            h
        };
        let residual = -self.velocity;
        self.update(&measure(VELOCITY), &residual, STANDING_MPS * STANDING_MPS);
        let residual = rate - self.rate_bias;
        let variance =
            self.covariance.fixed_view::<3, 3>(RATE_BIAS, RATE_BIAS).diagonal().max() + STANDING_RADPS.powi(2);
        if residual.norm_squared() < RATE_BIAS_GATE.powi(2) * variance {
            self.update(&measure(RATE_BIAS), &residual, STANDING_RADPS * STANDING_RADPS);
        }
    }

    /// Updates the filter with a measurement of equal variance along each axis.
    fn update<const M: usize>(&mut self, h: &SMatrix<f64, M, N>, residual: &SVector<f64, M>, variance: f64) {
        let cross = self.covariance * h.transpose();
        let innovation = h * cross + SMatrix::identity() * variance;
        let Some(inverse) = innovation.try_inverse() else { return };
        let gain = cross * inverse;
        self.covariance = symmetric(&(self.covariance - gain * cross.transpose()));
        self.cross_covariance -= self.cross_covariance * h.transpose() * gain.transpose();
        self.correct(&(gain * residual), true);
    }

    /// Corrects the state by the estimated errors.
    fn correct(&mut self, error: &SVector<f64, N>, has_biases: bool) {
        let part = |part: usize| error.fixed_rows::<3>(part).into_owned();
        self.displacement += part(POSITION);
        self.rotation = UnitQuaternion::from_scaled_axis(part(ROTATION)) * self.rotation;
        self.velocity += part(VELOCITY);
        self.level_from_begin = UnitQuaternion::from_scaled_axis(part(ATTITUDE)) * self.level_from_begin;
        if has_biases {
            self.rate_bias += part(RATE_BIAS);
            self.force_bias += part(FORCE_BIAS);
        }
    }
}

/// Derivative of a pose that is `displacement` away with respect to an error of rotation.
fn lever(displacement: &Vector3<f64>) -> Matrix6<f64> {
    let mut lever = Matrix6::identity();
    lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-displacement.cross_matrix());
    lever
}

fn diagonal(translation: f64, rotation: f64) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(translation, translation, translation, rotation, rotation, rotation))
}

fn symmetric<const M: usize>(m: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    (m + m.transpose()) * 0.5
}

/// The inverse of a positive definite matrix; zero (no information) where rounding has made it singular.
fn inverse(m: &Matrix6<f64>) -> Matrix6<f64> {
    symmetric(m).cholesky().map_or_else(Matrix6::zeros, |cholesky| cholesky.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::InertialSample;
    use geometry::Isometry3;

    const ACCELERATION: Acceleration = Acceleration { linear_mps2: 2.0, angular_radps2: 0.5 };

    /// The covariance after ten steps per second of 1 m along x, each measured with `drift_information`.
    fn covariance_after(n_steps: u32, drift_information: &Matrix6<f64>) -> Matrix6<f64> {
        let mounting = SensorMounting::default();
        let mut log = SensorLog::default();
        let stamp = |step: u32| Stamp(i64::from(step) * 100_000_000);
        let mut navigation = Navigation::begin(&(Vector3::x() * 10.0), true, &log, [stamp(0), stamp(1)]);
        for axis in [VELOCITY, VELOCITY + 1, VELOCITY + 2] {
            navigation.covariance[(axis, axis)] = 0.01;
        }
        for step in 0..n_steps {
            let [from, to] = [step, step + 1].map(|at| Isometry3::translation(f64::from(at), 0.0, 0.0));
            let stamps = [stamp(step), stamp(step + 1)];
            let predicted = navigation.predict(&mut log, &mounting, &from, stamps, ACCELERATION, &Vector3::zeros());
            let measurement =
                StepMeasurement { information: *drift_information, drift_information: *drift_information };
            navigation.update_step(&mounting, [&from, &to], &predicted, Some(&measurement));
        }
        navigation.pose_covariance()
    }

    #[test]
    fn errors_of_measured_steps_add_up_as_a_random_walk() {
        let known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-4_f64.powi(2));
        let covariance = covariance_after(100, &known);
        let [x, y] = [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()];
        assert!((x / 0.05 - 1.0).abs() < 0.05, "100 steps of 5 mm: {x}");
        // Each rotation of 0.1 mrad moves the end by the remaining path length: a sum of squares from 0 to 99 m.
        let by_rotation = 1e-4 * (0..100).map(|m| f64::from(m * m)).sum::<f64>().sqrt();
        assert!((y / x.hypot(by_rotation) - 1.0).abs() < 0.05, "{y} for {by_rotation}");
    }

    #[test]
    fn covariance_of_a_degenerate_direction_grows_with_the_unknown_speed() {
        let mut known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-5_f64.powi(2));
        known[(0, 0)] = 0.0;
        let covariance = covariance_after(100, &known);
        let mut expected = 0.1_f64.powi(2) * 100.0;
        for number in 0..100 {
            // A speed change of 0.2 m/s lasts to the end.
            expected += (0.2 * 0.1 * f64::from(100 - number)).powi(2);
        }
        assert!((covariance[(0, 0)] / expected - 1.0).abs() < 0.01, "{} {expected}", covariance[(0, 0)]);
        assert!(covariance[(1, 1)].sqrt() < 0.06, "{}", covariance[(1, 1)]);
        let height = (covariance[(2, 2)] / covariance[(0, 0)]).sqrt();
        assert!((height / 0.1 - 1.0).abs() < 0.02, "a tenth of the horizontal error, not {height}");
    }

    /// Standard deviation of the heading, rad, after ten seconds of sweeps that measure it with 1 mrad each, with
    /// inertial samples.
    fn heading_deviation_with_samples() -> f64 {
        let mounting = SensorMounting::default();
        let mut log = SensorLog::default();
        for number in 0..1100 {
            let stamp = Stamp(i64::from(number) * 10_000_000);
            log.push_inertial(InertialSample { stamp, force: Vector3::new(0.0, 0.0, 9.806), rate: Vector3::zeros() });
        }
        let stamp = |step: u32| Stamp(i64::from(step) * 100_000_000);
        let mut navigation = Navigation::begin(&(Vector3::x() * 10.0), true, &log, [stamp(0), stamp(1)]);
        let information = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-3_f64.powi(2));
        for step in 1..100 {
            let [from, to] = [step, step + 1].map(|at| Isometry3::translation(f64::from(at), 0.0, 0.0));
            let stamps = [stamp(step), stamp(step + 1)];
            let predicted = navigation.predict(&mut log, &mounting, &from, stamps, ACCELERATION, &Vector3::zeros());
            assert!(predicted.sources.inertial);
            let measurement = StepMeasurement { information, drift_information: information };
            navigation.update_step(&mounting, [&from, &to], &predicted, Some(&measurement));
        }
        navigation.pose_covariance()[(5, 5)].sqrt()
    }

    #[test]
    fn bias_of_gyroscopes_is_measured_by_all_sweeps_of_the_map() {
        let found = heading_deviation_with_samples();
        assert!(found < 0.01, "matches alone have 10 mrad, and gyroscopes only help: {found} rad");
    }

    #[test]
    fn unknown_position_has_an_unknown_inclination_of_a_road() {
        let mut known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-5_f64.powi(2));
        let inclination = |known: &Matrix6<f64>| covariance_after(100, known)[(4, 4)].sqrt();
        assert!(inclination(&known) < 1e-3, "{} rad", inclination(&known));
        known[(0, 0)] = 0.0;
        assert!((5e-3..0.1).contains(&inclination(&known)), "{} rad", inclination(&known));
    }

    #[test]
    fn unmeasured_heading_does_not_spin() {
        let mut known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-5_f64.powi(2));
        known[(5, 5)] = 0.0;
        let covariance = covariance_after(100, &known);
        let heading = covariance[(5, 5)].sqrt();
        // A constant rate of 0.5 rad/s would be 5 rad after ten seconds.
        assert!((0.05..1.0).contains(&heading), "{heading} rad after ten seconds");
    }

    #[test]
    fn standstill_shows_the_bias_of_the_gyroscopes() {
        let mounting = SensorMounting::default();
        let mut log = SensorLog::default();
        let bias = Vector3::new(0.001, -0.002, 0.004);
        for number in 0..120 {
            let stamp = Stamp(i64::from(number) * 10_000_000);
            let force = Vector3::new(0.0, 0.0, 9.806);
            log.push_inertial(InertialSample { stamp, force, rate: bias });
        }
        let stamp = |step: u32| Stamp(i64::from(step) * 100_000_000);
        let mut navigation = Navigation::begin(&Vector3::zeros(), true, &log, [stamp(0), stamp(1)]);
        let at = Isometry3::identity();
        for step in 5..10 {
            let stamps = [stamp(step), stamp(step + 1)];
            let predicted = navigation.predict(&mut log, &mounting, &at, stamps, ACCELERATION, &Vector3::zeros());
            navigation.update_step(&mounting, [&at, &at], &predicted, None);
            navigation.update_standstill(&log, stamp(step + 1));
        }
        assert!((navigation.rate_bias - bias).norm() < 0.1 * bias.norm(), "{}", navigation.rate_bias);
    }
}
