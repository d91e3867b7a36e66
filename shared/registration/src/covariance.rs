//! How far off the pose may be: the covariance of a walk whose steps are measured by matching.

use geometry::Pose;
use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Variance of a step that no sensor measures, m^2 or rad^2: a kilometre, or a radian and more. Finite, so that matrices can
/// be inverted.
const UNKNOWN: f64 = 1e6;

/// Covariance of the pose now and of the velocity now, both translation (m, m/s), then rotation (rad, rad/s), in odom axes
/// about the lidar.
///
/// A match measures the step from the map to the sweep, and so, in first order, from the sweep before: it makes the velocity
/// known, but takes nothing off the pose's error, which adds up. In directions that a match leaves open the velocity goes on
/// as it was, ever less known, and the pose's error grows with the time squared.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Uncertainty {
    joint: SMatrix<f64, 12, 12>,
}

/// What is known of a step, as inverse covariances.
pub(crate) struct StepKnowledge<'a> {
    /// Of the step, by matching; zero where there is no match.
    pub by_match: &'a Matrix6<f64>,
    /// Of the step, by another sensor; zero where there is none.
    pub by_sensor: &'a Matrix6<f64>,
    /// Changes of velocity to be expected, m/s^2 and rad/s^2.
    pub acceleration: (f64, f64),
}

impl Uncertainty {
    /// The pose is given and the velocity is not known better than `speed` m/s and `turn_rate` rad/s.
    pub fn at_begin(speed: f64, turn_rate: f64) -> Self {
        let mut joint = SMatrix::<f64, 12, 12>::zeros();
        joint.fixed_view_mut::<6, 6>(6, 6).copy_from(&diagonal(speed * speed, turn_rate * turn_rate));
        Self { joint }
    }

    /// Of the pose.
    pub fn pose(&self) -> Matrix6<f64> {
        self.joint.fixed_view::<6, 6>(0, 0).into_owned()
    }

    /// Goes on from one pose to the next, `seconds` later.
    pub fn advance(&mut self, from: &Pose, to: &Pose, seconds: f64, step: &StepKnowledge<'_>) {
        let way = to.translation.vector - from.translation.vector;
        let (linear, angular) = step.acceleration;
        let noise = diagonal((linear * seconds).powi(2), (angular * seconds).powi(2));
        let pose = self.pose();
        let velocity = self.joint.fixed_view::<6, 6>(6, 6) + noise;
        let pose_velocity = self.joint.fixed_view::<6, 6>(0, 6).into_owned();
        // Of the step alone, as the velocity foretells it.
        let foretold = velocity * (seconds * seconds);
        // Where neither matching nor a sensor knows anything the measurement's variance is as good as infinite.
        let information = step.by_match + step.by_sensor + diagonal(1.0 / UNKNOWN, 1.0 / UNKNOWN);
        let measured = inverse(&information);
        let gain = foretold * inverse(&(foretold + measured));
        let rest = Matrix6::identity() - gain;
        // The velocity's error is the step's over the time.
        let step_after = rest * foretold;
        let velocity_after = step_after / (seconds * seconds);
        // What is left of the velocity's error that was already part of the pose's.
        let shared = pose_velocity * rest.transpose();
        let lever = lever(&way);
        let moved = lever * pose * lever.transpose();
        let mixed = lever * shared * seconds;
        let pose_after = moved + mixed + mixed.transpose() + step_after;
        let pose_velocity_after = lever * shared + step_after / seconds;
        self.joint.fixed_view_mut::<6, 6>(0, 0).copy_from(&symmetric(&pose_after));
        self.joint.fixed_view_mut::<6, 6>(0, 6).copy_from(&pose_velocity_after);
        self.joint.fixed_view_mut::<6, 6>(6, 0).copy_from(&pose_velocity_after.transpose());
        self.joint.fixed_view_mut::<6, 6>(6, 6).copy_from(&symmetric(&velocity_after));
    }
}

/// Inverse covariance, in odom axes, of the step that a velocity in the lidar's axes makes in `seconds`.
pub(crate) fn step_information(covariance: &Matrix6<f64>, at: &Pose, seconds: f64) -> Matrix6<f64> {
    let rotation = at.rotation.to_rotation_matrix();
    let mut turn = Matrix6::zeros();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
    turn.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
    inverse(&(turn * covariance * turn.transpose() * (seconds * seconds)))
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

fn symmetric(m: &Matrix6<f64>) -> Matrix6<f64> {
    (m + m.transpose()) * 0.5
}

/// The inverse of a positive definite matrix; where rounding has made it singular, of one a little larger.
fn inverse(m: &Matrix6<f64>) -> Matrix6<f64> {
    let m = symmetric(m);
    (-15..=0)
        .map(|power| if power == -15 { 0.0 } else { m.amax() * 10_f64.powi(power) })
        .find_map(|more| (m + Matrix6::identity() * more).cholesky())
        .map_or_else(|| diagonal(UNKNOWN, UNKNOWN), |cholesky| cholesky.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Isometry3;

    const ACCELERATION: (f64, f64) = (2.0, 0.5);

    /// Ten steps a second of 1 m along x, each known as `by_match` says.
    fn after(n_steps: u32, by_match: &Matrix6<f64>, by_sensor: &Matrix6<f64>) -> Matrix6<f64> {
        let mut uncertainty = Uncertainty::at_begin(0.1, 0.01);
        for number in 0..n_steps {
            let [from, to] = [number, number + 1].map(|at| Isometry3::translation(f64::from(at), 0.0, 0.0));
            let step = StepKnowledge { by_match, by_sensor, acceleration: ACCELERATION };
            uncertainty.advance(&from, &to, 0.1, &step);
        }
        uncertainty.pose()
    }

    #[test]
    fn errors_of_measured_steps_add_up_as_a_walk() {
        let known = diagonal(1.0 / 0.005_f64.powi(2), 1.0 / 1e-4_f64.powi(2));
        let covariance = after(100, &known, &Matrix6::zeros());
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
        let covariance = after(100, &known, &Matrix6::zeros());
        let mut expected = 0.1_f64.powi(2) * 100.0;
        for number in 0..100 {
            // A change of speed of 0.2 m/s lasts to the end.
            expected += (0.2 * 0.1 * f64::from(100 - number)).powi(2);
        }
        assert!((covariance[(0, 0)] / expected - 1.0).abs() < 0.01, "{} {expected}", covariance[(0, 0)]);
        assert!(covariance[(1, 1)].sqrt() < 0.06, "{}", covariance[(1, 1)]);
    }

    #[test]
    fn another_sensor_keeps_an_open_direction_small() {
        let sensor = diagonal(1.0 / 0.01_f64.powi(2), 1.0);
        let covariance = after(100, &Matrix6::zeros(), &sensor);
        let x = covariance[(0, 0)].sqrt();
        assert!((0.08..0.11).contains(&x), "100 steps of 1 cm: {x}");
    }
}
