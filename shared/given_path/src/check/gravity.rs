//! Roll and pitch of the path against gravity: the forces of the inertial unit less the acceleration of the path.

use crate::GivenPath;
use drive::imu::ImuSample;
use geometry::{Stamp, Vector3};

/// Largest angle between both mean directions, rad: 3 degrees. A unit that is mounted 1 degree off and an acceleration of
/// 0.2 m/s² that lasts stay below.
const MAX_ANGLE_RAD: f64 = 0.052;
/// Least time of samples, s: shorter means contain the vibration of the vehicle.
const MIN_SECONDS: f64 = 10.0;
/// Half of the time over which the acceleration of the path is measured. Noise of the path of 2 cm is 0.2 m/s² of a sample, and
/// nearly nothing of the mean. In a bend at the start of a simulated drive of 12 s, the acceleration turns the mean by 4 degrees.
const HALF_WINDOW_NANOS: i64 = 500_000_000;
/// Acceleration of gravity, m/s².
const GRAVITY_MPS2: f64 = 9.81;
/// Samples that are compared at most.
const MAX_SAMPLES: usize = 20_000;

/// The path at a time.
struct Motion {
    /// Direction of the vertical in body axes.
    up_in_body: Vector3<f64>,
    /// m/s².
    acceleration_in_body: Vector3<f64>,
}

/// `None` within half a second of the ends of the path.
fn motion_at(path: &GivenPath, stamp: Stamp) -> Option<Motion> {
    let [first, last] = path.span();
    let before = stamp.plus_nanos(-HALF_WINDOW_NANOS);
    let after = stamp.plus_nanos(HALF_WINDOW_NANOS);
    if before < first || after > last {
        return None;
    }
    let pose = path.at(stamp)?;
    let place = |stamp: Stamp| Some(path.at(stamp)?.translation.vector);
    let seconds = HALF_WINDOW_NANOS as f64 * 1e-9;
    let acceleration = (place(before)? - pose.translation.vector * 2.0 + place(after)?) / (seconds * seconds);
    let body_from_world = pose.rotation.inverse();
    Some(Motion { up_in_body: body_from_world * Vector3::z(), acceleration_in_body: body_from_world * acceleration })
}

pub(super) fn agrees(path: &GivenPath, imu: &[ImuSample]) -> Result<String, String> {
    let [begin, end] = path.span();
    let within: Vec<&ImuSample> = imu.iter().filter(|sample| (begin..=end).contains(&sample.stamp)).collect();
    let seconds = within.first().zip(within.last()).map_or(0.0, |(first, last)| last.stamp.seconds_since(first.stamp));
    if seconds < MIN_SECONDS {
        return Ok("roll and pitch not compared: no inertial unit for 10 s within the time of the path".into());
    }
    let mut forces = Vector3::zeros();
    let mut sum_of_norms = 0.0;
    let mut accelerations = Vector3::zeros();
    let mut by_path = Vector3::zeros();
    let mut n = 0;
    for sample in within.iter().step_by(within.len() / MAX_SAMPLES + 1) {
        if let Some(motion) = motion_at(path, sample.stamp) {
            let force = Vector3::from(sample.acceleration);
            forces += force;
            sum_of_norms += force.norm();
            accelerations += motion.acceleration_in_body;
            by_path += motion.up_in_body;
            n += 1;
        }
    }
    // The unit may measure in g.
    let units_per_mps2 = sum_of_norms / (GRAVITY_MPS2 * f64::from(n.max(1)));
    let by_unit = forces - accelerations * units_per_mps2;
    let angle = by_unit.angle(&by_path);
    if angle <= MAX_ANGLE_RAD {
        return Ok(format!("roll and pitch agree with gravity (mean difference {:.1} deg)", angle.to_degrees()));
    }
    // Roll and pitch of the mean direction: x forward, y left, z up.
    let tilt = |up: Vector3<f64>| [up.y.atan2(up.z), -up.x.atan2(up.y.hypot(up.z))];
    let ([roll, pitch], [given_roll, given_pitch]) = (tilt(by_unit), tilt(by_path));
    let near = |a: f64, b: f64| (a - b).abs() < MAX_ANGLE_RAD;
    let hint = if by_path.z < 0.0 {
        "the path is upside down: a z axis points down where it should point up"
    } else if near(roll, -given_roll) && near(pitch, given_pitch) {
        "the opposite roll would fit: roll must be positive with the right side down"
    } else if near(roll, given_roll) && near(pitch, -given_pitch) {
        "the opposite pitch would fit: pitch must be positive with the nose up"
    } else if near(roll, -given_roll) && near(pitch, -given_pitch) {
        "the opposite roll and pitch would fit: an axis is mirrored"
    } else if near(roll, given_pitch) && near(pitch, given_roll) {
        "exchanged roll and pitch would fit"
    } else {
        "check the columns of roll and pitch, their unit, and trajectory.body_from_reference"
    };
    Err(format!(
        "roll and pitch differ from gravity by {:.1} deg (path: roll {:.1}, pitch {:.1}; inertial unit: roll {:.1}, pitch {:.1}); {hint}",
        angle.to_degrees(),
        given_roll.to_degrees(),
        -given_pitch.to_degrees(),
        roll.to_degrees(),
        -pitch.to_degrees()
    ))
}
