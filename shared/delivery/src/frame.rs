//! Header lines about the frame of a cloud.
//!
//! Clouds are first written in the frame of the odometry. The header of a cloud in its final frame contains the pose of its submap,
//! so that a restarted run does not move it again.

use formats::ply::{Header, PlyRows};
use geometry::Pose;
use messages::PoseDeviation;
use std::path::Path;

/// Prefix of the line with the frame of a cloud.
const FRAME: &str = "frame ";
/// Prefix of the line with the pose of the submap, present only in clouds in their final frame.
const PLACED: &str = "world_from_submap ";

/// The line of clouds in the frame of the odometry.
pub(crate) fn odometry_line() -> String {
    frame_line("odometry, m")
}

/// Whether a cloud has this header before its final pose is known.
pub fn is_in_odometry(header: &Header) -> bool {
    header.infos.contains(&odometry_line())
}

/// The line of clouds in a frame.
pub(crate) fn frame_line(name: &str) -> String {
    format!("{FRAME}{name}")
}

/// The line with the pose of a submap.
pub(crate) fn pose_line(world_from_submap: &Pose) -> String {
    let t = world_from_submap.translation.vector;
    let q = world_from_submap.rotation.coords;
    format!("{PLACED}{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
}

/// The line with the standard deviations of that pose.
pub(crate) fn deviation_line(deviation: &PoseDeviation) -> String {
    let PoseDeviation { position_m, height_m, heading_deg } = deviation;
    format!("standard_deviation position_m {position_m:.3} height_m {height_m:.3} heading_deg {heading_deg:.3}")
}

/// Whether a file is a cloud of `n_points` points in its final frame.
pub(crate) fn is_placed(path: &Path, n_points: u64) -> bool {
    let has_pose = |cloud: &PlyRows| cloud.header().infos.iter().any(|info| info.starts_with(PLACED));
    PlyRows::open(path).is_ok_and(|cloud| cloud.len() as u64 == n_points && has_pose(&cloud))
}
