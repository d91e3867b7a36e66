//! The direction of travel over time.

use geometry::{Trajectory, Vector3};

/// Forward directions of the vehicle, by time.
pub(crate) struct PathHeading {
    times_s: Vec<f64>,
    /// Unit vectors.
    forward: Vec<[f64; 2]>,
}

impl PathHeading {
    /// `turn` is the angle from the y axis of the trajectory to the y axis of the clouds, clockwise, rad.
    pub(crate) fn new(trajectory: &Trajectory, turn: f64) -> Self {
        let (sin, cos) = turn.sin_cos();
        let forward = |pose: &geometry::Pose| {
            let ahead = pose.rotation * Vector3::x();
            // In axes rotated clockwise, directions appear rotated counter-clockwise.
            let x = ahead.x * cos - ahead.y * sin;
            let y = ahead.x * sin + ahead.y * cos;
            let length = x.hypot(y).max(f64::MIN_POSITIVE);
            [x / length, y / length]
        };
        let poses = trajectory.poses().iter();
        let (times_s, forward) = poses.map(|(stamp, pose)| (stamp.0 as f64 * 1e-9, forward(pose))).unzip();
        Self { times_s, forward }
    }

    /// Horizontal direction at a time, taken from the last pose before it, or from the first pose. `near` is the index of
    /// a pose near that time. It is updated, so that consecutive times need no search. A sweep has a pose at both ends,
    /// between which a vehicle turns by less than 5 degrees.
    #[inline]
    pub(crate) fn at(&self, time_s: f64, near: &mut usize) -> [f64; 2] {
        let is_at = |k: usize| {
            self.times_s.get(k).is_some_and(|begin| *begin <= time_s)
                && self.times_s.get(k + 1).is_none_or(|end| time_s < *end)
        };
        if !is_at(*near) {
            *near = self.times_s.partition_point(|begin| *begin <= time_s).saturating_sub(1);
        }
        self.forward.get(*near).copied().unwrap_or([1.0, 0.0])
    }
}
