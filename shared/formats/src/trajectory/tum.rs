//! TUM (Sturm et al., IROS 2012): one pose per line, `t tx ty tz qx qy qz qw`, seconds since the Unix epoch, m, unit
//! quaternion.

use super::line::{content_lines, parse_numbers, parse_stamp, rotation};
use super::{PoseFault, TrajectoryError};
use geometry::{Isometry3, Trajectory, Translation3};
use std::fmt::Write;

/// The trajectory in TUM format, stamps to the nanosecond.
pub fn tum_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (stamp, pose) in trajectory.poses() {
        let t = pose.translation.vector;
        let q = pose.rotation.coords;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{stamp} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads TUM format by the rules of the [module](super).
pub fn trajectory_from_tum(text: &str) -> Result<Trajectory, TrajectoryError> {
    let mut trajectory = Trajectory::default();
    for (line, fields) in content_lines(text) {
        let error = |fault: PoseFault| TrajectoryError { line, fault };
        let (stamp, numbers) = fields.split_once(char::is_whitespace).unwrap_or((fields, ""));
        let stamp = parse_stamp(stamp).map_err(error)?;
        let [x, y, z, quaternion @ ..] = parse_numbers::<7>(numbers).map_err(error)?;
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation(quaternion).map_err(error)?);
        super::push(&mut trajectory, line, stamp, pose)?;
    }
    Ok(trajectory)
}
