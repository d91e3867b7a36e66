//! How the vehicle moves between sweeps by what else is known, and how far off the pose may be: an error-state Kalman filter.
//!
//! It is robocentric (Huai and Huang, IROS 2018; with a lidar: Qin et al., LINS, ICRA 2020): everything is told in the body's
//! axes at the sweep before, the step from there is foretold by inertial samples, corrected by the receiver's velocities and by
//! the match, and becomes the next beginning. Without samples the motion goes on as it was, less and less known.
//!
//! The pose's own error since the first sweep is carried along, with what it shares with the filter's errors: a match measures
//! the step but takes nothing off what has added up (a Schmidt filter's part).

mod receiver;
mod step;
mod step_of_lidar;

use crate::SensorPlaces;
use crate::sensors::SensorLog;
use geometry::{Pose, Stamp, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector6};
use serde::{Deserialize, Serialize};
use step_of_lidar::StepOfLidar;

/// Errors, three numbers each: place and turn since the sweep before, velocity (all in the axes of the body then), attitude (level
/// axes), biases of gyroscopes and accelerometers.
const N: usize = 18;
const PLACE: usize = 0;
const TURN: usize = 3;
const VELOCITY: usize = 6;
const ATTITUDE: usize = 9;
const RATE_BIAS: usize = 12;
const FORCE_BIAS: usize = 15;

/// What is left of biases when an industrial inertial unit is switched on, m/s^2 and rad/s.
const FORCE_BIAS_SIGMA: f64 = 0.05;
const RATE_BIAS_SIGMA: f64 = 0.005;
/// What the velocity may be at the first sweep, forwards and otherwise, m/s: a vehicle in traffic.
const FIRST_SPEED: [f64; 3] = [15.0, 1.0, 1.0];
const FIRST_RATE: f64 = 0.5;
/// A first velocity that a receiver told, m/s.
const TOLD_SPEED: f64 = 0.5;
/// The first force points up within this, rad: braking by 1 m/s^2.
const FIRST_TILT: f64 = 0.1;
/// Poses jump about the map's by this, m and rad, which is no motion.
const POSE_NOISE: (f64, f64) = (5e-3, 5e-4);
/// A vehicle may stand if it is not known to be faster (m/s) or to speed up (m/s^2), and is known to stand within this, m/s.
const SLOW_MPS: f64 = 0.3;
const STANDING_MPS2: f64 = 0.15;
const STANDING_MPS: f64 = 0.02;
/// A road climbs or falls by less than this share of its way.
const GRADE: f64 = 0.1;
/// A velocity leads for so long, s.
const LEADING_SECONDS: f64 = 2.0;
/// A velocity that came late has changed by this, m/s^2.
const LATE_MPS2: f64 = 3.0;

/// What foretold a step besides the motion before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lean {
    /// Inertial samples.
    pub inertial: bool,
    /// Velocities of a receiver within the last two seconds.
    pub receiver: bool,
}

impl Lean {
    pub(crate) fn is_any(self) -> bool {
        self.inertial || self.receiver
    }
}

/// See the module. Part of the odometry's state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Navigation {
    /// Of this step: the inertial unit's way and the body's turn, axes of the body at its begin.
    way: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    /// Of the inertial unit, the same axes.
    velocity: Vector3<f64>,
    /// Axes: z up, and x east if `north_is_known`.
    level_from_begin: UnitQuaternion<f64>,
    north_is_known: bool,
    rate_bias: Vector3<f64>,
    force_bias: Vector3<f64>,
    /// How the body turned at the step's begin, rad/s.
    last_rate: Vector3<f64>,
    last_velocity: Option<Stamp>,
    n_refused: u32,
    covariance: SMatrix<f64, N, N>,
    /// Of the pose since the first sweep: translation, rotation, odom axes about the lidar.
    pose: Matrix6<f64>,
    /// Between the pose's errors and the filter's.
    shared: SMatrix<f64, 6, N>,
}

/// Where the lidar will be.
pub(crate) struct Foretold {
    pub mid: Pose,
    /// Inverse covariance of the pose in the map; zero if the motion before is all there is.
    pub information: Matrix6<f64>,
    pub lean: Lean,
}

/// What a match says of a step, as inverse covariances.
pub(crate) struct StepMeasure {
    /// Of the pose in the map. Nothing along directions that the scene leaves open.
    pub information: Matrix6<f64>,
    /// The same, by what errors add up to over a drive.
    pub drift_information: Matrix6<f64>,
}

impl Navigation {
    /// At the middle of the first sweep. `velocity` is that of the body, its axes.
    pub fn begin(velocity: &Vector3<f64>, is_told: bool, log: &SensorLog, [begin, end]: [Stamp; 2]) -> Self {
        let felt = log.mean(begin, end).filter(|_| log.covers(begin, end));
        let up = felt.map_or_else(Vector3::z, |(force, _)| force);
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let rate_bias = if felt.is_some() { RATE_BIAS_SIGMA } else { FIRST_RATE };
        for axis in 0..3 {
            let speed = if is_told { TOLD_SPEED } else { FIRST_SPEED[axis] };
            // Which way x points is nobody's error until north is known.
            let tilt = if axis < 2 { FIRST_TILT } else { 0.0 };
            let of: [(usize, f64); 4] =
                [(VELOCITY, speed), (ATTITUDE, tilt), (RATE_BIAS, rate_bias), (FORCE_BIAS, FORCE_BIAS_SIGMA)];
            for (part, sigma) in of {
                covariance[(part + axis, part + axis)] = sigma * sigma;
            }
        }
        Self {
            way: Vector3::zeros(),
            turn: UnitQuaternion::identity(),
            velocity: *velocity,
            level_from_begin: UnitQuaternion::rotation_between(&up, &Vector3::z()).unwrap_or_default(),
            north_is_known: false,
            rate_bias: Vector3::zeros(),
            force_bias: Vector3::zeros(),
            last_rate: Vector3::zeros(),
            last_velocity: None,
            n_refused: 0,
            covariance,
            pose: Matrix6::zeros(),
            shared: SMatrix::zeros(),
        }
    }

    /// Covariance of the pose: translation (m), then rotation (rad), odom axes about the lidar. The ground under the wheels is
    /// measured, and not how high it lies where the way has led: as far as that is not known, the height is not known by the grade
    /// that a road may have. (On a field a vehicle that seemed to stand knew its height within 30 cm and was 3 m off.)
    pub fn pose(&self) -> Matrix6<f64> {
        let mut pose = self.pose;
        pose[(2, 2)] += GRADE * GRADE * (pose[(0, 0)] + pose[(1, 1)]);
        pose
    }

    /// Goes on from the lidar's pose `from` at `begin` to `end`. `acceleration` (m/s^2, rad/s^2) is what changes the motion where
    /// nothing tells how, `last_rate` how the lidar turned at `begin` (its axes, rad/s).
    pub fn foretell(
        &mut self,
        log: &mut SensorLog,
        places: &SensorPlaces,
        from: &Pose,
        [begin, end]: [Stamp; 2],
        acceleration: (f64, f64),
        last_rate: &Vector3<f64>,
    ) -> Foretold {
        self.last_rate = places.body_from_lidar.rotation * last_rate;
        let is_felt = log.covers(begin, end);
        let mut at = begin;
        while let Some(mut told) = log.pop_velocity(end) {
            let until = told.stamp.max(at);
            self.go(log, is_felt, [at, until], acceleration);
            told.sigma += LATE_MPS2 * until.seconds_since(told.stamp);
            self.hear(&told, log, places);
            at = until;
        }
        self.go(log, is_felt, [at, end], acceleration);
        log.forget_before(begin);
        let receiver = self.last_velocity.is_some_and(|last| end.seconds_since(last) < LEADING_SECONDS);
        let lean = Lean { inertial: is_felt, receiver };
        let lidar = StepOfLidar::new(places, from, &self.turn);
        let information = if lean.inertial {
            let (m, rad) = POSE_NOISE;
            inverse(&(lidar.covariance(&self.covariance) + diagonal(m * m, rad * rad)))
        } else {
            Matrix6::zeros()
        };
        Foretold { mid: lidar.pose(&self.way, &self.turn), information, lean }
    }

    /// The step has led from the lidar's pose `from` to `to`. `foretold` is what the match leaned on and `measure` what it adds,
    /// `None` without a match.
    pub fn arrive(
        &mut self,
        places: &SensorPlaces,
        [from, to]: [&Pose; 2],
        foretold: &Foretold,
        measure: Option<&StepMeasure>,
    ) {
        let lidar = StepOfLidar::new(places, from, &self.turn);
        let h = lidar.jacobian;
        let step = lidar.covariance(&self.covariance);
        let [information, drift] = measure.map_or_else(
            || [Matrix6::zeros(); 2],
            // The step lies between two poses that both jump.
            |measure| [measure.information * 0.5, measure.drift_information],
        );
        // What the match leaves of the step's error, and the filter's errors after it.
        let left = (Matrix6::identity() + step * drift).try_inverse().unwrap_or_else(Matrix6::identity);
        let damping = (Matrix6::identity() + information * step).try_inverse().unwrap_or_else(Matrix6::zeros);
        let gain = self.covariance * h.transpose() * damping;
        let gain_information = gain * information;
        let after = self.covariance - gain_information * h * self.covariance;
        let shared_step = self.shared * h.transpose();
        let way = to.translation.vector - from.translation.vector;
        let lever = lever(&way);
        let mixed = lever * shared_step * left.transpose();
        self.pose = symmetric(&(lever * self.pose * lever.transpose() + mixed + mixed.transpose() + left * step));
        self.shared = lever * (self.shared - shared_step * gain_information.transpose()) + left * h * after;
        self.covariance = after;
        let predicted = lidar.pose(&self.way, &self.turn);
        let mut off = Vector6::zeros();
        off.fixed_rows_mut::<3>(0).copy_from(&(to.translation.vector - predicted.translation.vector));
        off.fixed_rows_mut::<3>(3).copy_from(&(to.rotation * predicted.rotation.inverse()).scaled_axis());
        // The pose lies between what was foretold and what the match alone wants: without the former it would be so much farther.
        let little = diagonal(1.0, 1e2);
        let beyond =
            (information + little).try_inverse().unwrap_or_else(Matrix6::zeros) * foretold.information * off * 0.5;
        self.correct(&(gain * (information * (off + beyond))), foretold.lean.inertial);
        self.turn_to_end();
    }

    /// The vehicle does not move, say the inertial samples, and nobody contradicts.
    pub fn stand(&mut self, log: &SensorLog, at: Stamp) {
        let stands = |force: Vector3<f64>| (force - self.force_bias + self.gravity()).norm() < STANDING_MPS2;
        if self.velocity.norm() < SLOW_MPS && log.still(at).is_some_and(stands) {
            let mut h = SMatrix::<f64, 3, N>::zeros();
            h.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&Matrix3::identity());
            let residual = -self.velocity;
            self.update(&h, &residual, STANDING_MPS * STANDING_MPS);
        }
    }

    /// A measurement with the same variance along each of its axes.
    fn update<const M: usize>(&mut self, h: &SMatrix<f64, M, N>, residual: &SVector<f64, M>, variance: f64) {
        let across = self.covariance * h.transpose();
        let spread = h * across + SMatrix::identity() * variance;
        let Some(inverse) = spread.try_inverse() else { return };
        let gain = across * inverse;
        self.covariance = symmetric(&(self.covariance - gain * across.transpose()));
        self.shared -= self.shared * h.transpose() * gain.transpose();
        self.correct(&(gain * residual), true);
    }

    /// Takes errors out of what is known.
    fn correct(&mut self, error: &SVector<f64, N>, has_biases: bool) {
        let part = |part: usize| error.fixed_rows::<3>(part).into_owned();
        self.way += part(PLACE);
        self.turn = UnitQuaternion::from_scaled_axis(part(TURN)) * self.turn;
        self.velocity += part(VELOCITY);
        self.level_from_begin = UnitQuaternion::from_scaled_axis(part(ATTITUDE)) * self.level_from_begin;
        if has_biases {
            self.rate_bias += part(RATE_BIAS);
            self.force_bias += part(FORCE_BIAS);
        }
    }
}

/// An error of rotation moves what is `way` farther.
fn lever(way: &Vector3<f64>) -> Matrix6<f64> {
    let mut lever = Matrix6::identity();
    lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-way.cross_matrix());
    lever
}

fn diagonal(translation: f64, rotation: f64) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(translation, translation, translation, rotation, rotation, rotation))
}

fn symmetric<const M: usize>(m: &SMatrix<f64, M, M>) -> SMatrix<f64, M, M> {
    (m + m.transpose()) * 0.5
}

/// The inverse of a positive definite matrix; nothing is known where rounding has made it singular.
fn inverse(m: &Matrix6<f64>) -> Matrix6<f64> {
    symmetric(m).cholesky().map_or_else(Matrix6::zeros, |cholesky| cholesky.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    const ACCELERATION: (f64, f64) = (2.0, 0.5);

    /// Ten steps a second of 1 m along x, each known as `drift_information` says.
    fn after(n_steps: u32, drift_information: &Matrix6<f64>) -> Matrix6<f64> {
        let (places, mut log) = (SensorPlaces::default(), SensorLog::default());
        let stamp = |step: u32| Stamp(i64::from(step) * 100_000_000);
        let mut navigation = Navigation::begin(&(Vector3::x() * 10.0), true, &log, [stamp(0), stamp(1)]);
        for axis in [VELOCITY, VELOCITY + 1, VELOCITY + 2] {
            navigation.covariance[(axis, axis)] = 0.01;
        }
        for step in 0..n_steps {
            let [from, to] = [step, step + 1].map(|at| Isometry3::translation(f64::from(at), 0.0, 0.0));
            let stamps = [stamp(step), stamp(step + 1)];
            let foretold = navigation.foretell(&mut log, &places, &from, stamps, ACCELERATION, &Vector3::zeros());
            let measure = StepMeasure { information: *drift_information, drift_information: *drift_information };
            navigation.arrive(&places, [&from, &to], &foretold, Some(&measure));
        }
        navigation.pose()
    }

    #[test]
    fn errors_of_measured_steps_add_up_as_a_walk() {
        let known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-4_f64.powi(2));
        let covariance = after(100, &known);
        let [x, y] = [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()];
        assert!((x / 0.05 - 1.0).abs() < 0.05, "100 steps of 5 mm: {x}");
        // Each turn of 0.1 mrad moves what is left of 100 m: a sum of squares from 0 to 99 m.
        let turned = 1e-4 * (0..100).map(|way| f64::from(way * way)).sum::<f64>().sqrt();
        assert!((y / x.hypot(turned) - 1.0).abs() < 0.05, "{y} for {turned}");
    }

    #[test]
    fn an_open_direction_grows_with_the_speed_that_it_may_have_and_others_do_not() {
        let mut known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-5_f64.powi(2));
        known[(0, 0)] = 0.0;
        let covariance = after(100, &known);
        let mut expected = 0.1_f64.powi(2) * 100.0;
        for number in 0..100 {
            // A change of speed of 0.2 m/s lasts to the end.
            expected += (0.2 * 0.1 * f64::from(100 - number)).powi(2);
        }
        assert!((covariance[(0, 0)] / expected - 1.0).abs() < 0.01, "{} {expected}", covariance[(0, 0)]);
        assert!(covariance[(1, 1)].sqrt() < 0.06, "{}", covariance[(1, 1)]);
        let height = (covariance[(2, 2)] / covariance[(0, 0)]).sqrt();
        assert!((height / 0.1 - 1.0).abs() < 0.02, "a tenth of the way that is not known, not {height}");
    }
}
