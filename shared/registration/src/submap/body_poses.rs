//! The poses of the body that topic `trajectory` carries.

use crate::Registered;
use geometry::Pose;
use messages::StampedPose;
use serde::{Deserialize, Serialize};

/// Collects poses with non-decreasing stamps.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct BodyPoses {
    last_stamp: Option<i64>,
}

impl BodyPoses {
    /// Appends the poses of the body, `odom_from_body`, at the first and at the last shot of a sweep to `poses`.
    /// Returns them with the number of skipped poses, which would be earlier than the last one.
    pub fn add(
        &mut self,
        registered: &Registered,
        body_from_lidar: &Pose,
        poses: &mut Vec<StampedPose>,
    ) -> ([Pose; 2], u64) {
        let odom_from_body = |odom_from_lidar: Pose| odom_from_lidar * body_from_lidar.inverse();
        let ends = [odom_from_body(registered.begin()), odom_from_body(registered.end())];
        let mut n_left_out = 0;
        for (stamp, pose) in [registered.stamp.0, registered.end_stamp().0].into_iter().zip(ends) {
            if self.last_stamp.is_none_or(|last| last <= stamp) {
                poses.push(StampedPose { stamp, odom_from_body: pose.into() });
                self.last_stamp = Some(stamp);
            } else {
                n_left_out += 1;
            }
        }
        (ends, n_left_out)
    }
}
