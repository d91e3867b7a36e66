//! Roll and pitch of the path against gravity.

use crate::GivenPath;
use drive::imu::ImuSample;
use geometry::Vector3;

/// Largest angle between both mean directions, rad: 3 degrees. A unit that is mounted 1 degree off and an acceleration of
/// 0.2 m/s² that lasts stay below.
const MAX_ANGLE_RAD: f64 = 0.052;
/// Least time of samples, s: shorter means contain the acceleration of the vehicle.
const MIN_SECONDS: f64 = 10.0;
/// Samples that are compared at most.
const MAX_SAMPLES: usize = 20_000;

pub(super) fn agrees(path: &GivenPath, imu: &[ImuSample]) -> Result<String, String> {
    let [begin, end] = path.span();
    let within: Vec<&ImuSample> = imu.iter().filter(|sample| (begin..=end).contains(&sample.stamp)).collect();
    let seconds = within.first().zip(within.last()).map_or(0.0, |(first, last)| last.stamp.seconds_since(first.stamp));
    if seconds < MIN_SECONDS {
        return Ok("roll and pitch not compared: no inertial unit for 10 s within the time of the path".into());
    }
    let mut by_unit = Vector3::zeros();
    let mut by_path = Vector3::zeros();
    for sample in within.iter().step_by(within.len() / MAX_SAMPLES + 1) {
        if let Some(pose) = path.at(sample.stamp) {
            by_unit += Vector3::from(sample.acceleration);
            by_path += pose.rotation.inverse() * Vector3::z();
        }
    }
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
