//! SBET (see [`formats::sbet`]) of a run: velocities towards north, east and down, no wander angle, no accelerations.

use super::level_pose;
use formats::gps_time::week_seconds_from_unix;
use formats::sbet::{RECORD_BYTES, SbetRecord};
use geometry::{LocalFrame, Point3, Pose, Trajectory, UnitQuaternion, Vector3};

/// The content of an SBET file. Times continue to count beyond the end of a week. Accelerations are not estimated.
pub(super) fn bytes(trajectory: &Trajectory, local: &LocalFrame) -> Vec<u8> {
    let poses = trajectory.poses();
    let mut bytes = Vec::with_capacity(poses.len() * RECORD_BYTES);
    let unix_s = |i: usize| poses[i].0.0 as f64 * 1e-9;
    // A week may end during the drive.
    let first_s = poses.first().map_or(0.0, |_| week_seconds_from_unix(unix_s(0)));
    for (i, (stamp, pose)) in poses.iter().enumerate() {
        let time_s = first_s + stamp.seconds_since(poses[0].0);
        let place = local.geodetic_from_world(&Point3::from(pose.translation.vector));
        let level = level_pose(pose, local);
        let before = &poses[i.saturating_sub(1)];
        let after = &poses[(i + 1).min(poses.len() - 1)];
        let seconds = after.0.seconds_since(before.0).max(1e-9);
        let velocity = (level.rotation * pose.rotation.inverse())
            * ((after.1.translation.vector - before.1.translation.vector) / seconds);
        let turn = (before.1.rotation.inverse() * after.1.rotation).scaled_axis() / seconds;
        let (roll, pitch, heading) = attitude(&level);
        let heading = heading.rem_euclid(std::f64::consts::TAU);
        let record = SbetRecord {
            time_s,
            latitude_rad: place.latitude_deg.to_radians(),
            longitude_rad: place.longitude_deg.to_radians(),
            altitude_m: place.altitude_m,
            velocity: [velocity.y, velocity.x, -velocity.z],
            roll_rad: roll,
            pitch_rad: pitch,
            platform_heading_rad: heading,
            wander_rad: 0.0,
            acceleration: [0.0; 3],
            turn_rates: [turn.x, -turn.y, -turn.z],
        };
        bytes.extend(record.to_bytes());
    }
    bytes
}

/// Roll, pitch and heading, rad: rotations about x forward, y right and z down, from north, east and down.
fn attitude(level: &Pose) -> (f64, f64, f64) {
    // From forward, left, up to forward, right, down: half a turn about x. From north, east, down to east, north, up: half a turn about
    // the bisector of north and east.
    let half = std::f64::consts::PI;
    let flu_from_frd = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), half);
    let diagonal = geometry::Vector3::new(1.0, 1.0, 0.0).normalize();
    let ned_from_enu = UnitQuaternion::from_scaled_axis(diagonal * half);
    (ned_from_enu * level.rotation * flu_from_frd).euler_angles()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Geodetic, Isometry3, Stamp};

    #[test]
    fn drive_to_the_south_east_has_its_heading_and_velocity() {
        let local = LocalFrame::new(Geodetic::new(48.846_222, 2.346_414, 104.6).expect("a position"));
        let mut trajectory = Trajectory::default();
        // Yaw of -45 degrees from east: south-east. Nose up by 0.1, right side down by 0.05.
        let yaw = UnitQuaternion::from_euler_angles(0.05, -0.1, -std::f64::consts::FRAC_PI_4);
        for i in 0..3_i64 {
            let position = geometry::Translation3::new(i as f64, -(i as f64), 0.0);
            let stamp = Stamp(1_726_230_400_000_000_000 + i * 100_000_000);
            trajectory.push(stamp, Isometry3::from_parts(position, yaw));
        }
        let bytes = bytes(&trajectory, &local);
        assert_eq!(bytes.len(), 3 * 136);
        let row: Vec<f64> = bytes[136..272].as_chunks().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
        let near = |found: f64, expected: f64, tolerance: f64| {
            assert!((found - expected).abs() < tolerance, "{found}, expected {expected}");
        };
        near(row[0], 476_818.1, 1e-6);
        near(row[1].to_degrees(), 48.846_213, 1e-6);
        near(row[4], -10.0, 1e-3);
        near(row[5], 10.0, 1e-3);
        near(row[7], 0.05, 1e-5);
        near(row[8], 0.1, 1e-5);
        near(row[9].to_degrees(), 135.0, 1e-3);
    }
}
