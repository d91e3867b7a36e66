//! Sweeps of the other LiDARs of a vehicle: they move with the first one. Only the first one is matched.

use crate::given_motion::pose_on;
use crate::moving_objects::MovingDetector;
use crate::{Registered, Sweep, SweepMotion};
use geometry::{Pose, Stamp};
use serde::{Deserialize, Serialize};

/// A LiDAR that is rigidly mounted to the first one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SecondaryLidar {
    first_from_lidar: Pose,
    /// The detector of this LiDAR: free space is space that its own rays have passed, from its own position.
    moving: MovingDetector,
}

impl SecondaryLidar {
    /// `body_from_first` and `body_from_lidar` are the mountings of the first and of this LiDAR.
    pub fn new(body_from_first: &Pose, body_from_lidar: &Pose) -> Self {
        Self { first_from_lidar: body_from_first.inverse() * body_from_lidar, moving: MovingDetector::default() }
    }

    /// Returns the motion of this LiDAR during one of its sweeps, and its points on moving objects. The motion is
    /// derived from the first LiDAR during `first`, a sweep of the same time; this LiDAR has no match of its own.
    pub fn follow(&mut self, sweep: &Sweep, first: &Registered) -> Registered {
        let motion = self.motion(sweep, first);
        if first.map_restarted {
            self.moving = MovingDetector::default();
        }
        // As for the first LiDAR: without a match, static objects would appear to move.
        let mut moving = Vec::new();
        if first.matched.is_some() || first.is_given() {
            let found = self.moving.detect(sweep, &motion);
            self.moving.add_sweep(sweep, &motion, &found);
            moving = found.points;
        }
        Registered {
            stamp: sweep.stamp(),
            duration_nanos: sweep.duration_nanos(),
            motion,
            path: self.path(sweep, first),
            matched: None,
            contrast: None,
            map_restarted: false,
            moving,
            ..first.clone()
        }
    }

    /// The poses of this LiDAR during its sweep, if the poses are given.
    fn path(&self, sweep: &Sweep, first: &Registered) -> Vec<Pose> {
        let duration_nanos = f64::from(first.duration_nanos.max(1));
        let offset_nanos = (sweep.stamp().0 - first.stamp.0) as f64;
        let n = first.path.len().saturating_sub(1).max(1) as f64;
        let pose_at = |step: usize| {
            let nanos = offset_nanos + f64::from(sweep.duration_nanos()) * step as f64 / n;
            pose_on(&first.path, nanos / duration_nanos) * self.first_from_lidar
        };
        (0..first.path.len()).map(pose_at).collect()
    }

    fn motion(&self, sweep: &Sweep, first: &Registered) -> SweepMotion {
        let pose_at = |stamp: Stamp| {
            let share = match first.duration_nanos {
                0 => 0.0,
                duration => (stamp.0 - first.stamp.0) as f64 / f64::from(duration) - 0.5,
            };
            first.motion.at(share) * self.first_from_lidar
        };
        let begin = pose_at(sweep.stamp());
        let end = pose_at(sweep.stamp().plus_nanos(i64::from(sweep.duration_nanos())));
        let translation = end.translation.vector - begin.translation.vector;
        SweepMotion {
            mid: pose_at(sweep.mid_stamp()),
            translation,
            rotation: (begin.rotation.inverse() * end.rotation).scaled_axis(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedPoint;
    use geometry::{Isometry3, Translation3, UnitQuaternion, Vector3};
    use nalgebra::Matrix6;

    fn pose(translation: [f64; 3], rotation: [f64; 3]) -> Pose {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(rotation));
        Isometry3::from_parts(Translation3::from(translation), rotation)
    }

    #[test]
    fn other_lidar_moves_with_the_first_around_the_body() {
        let body_from_first = pose([0.0, 0.0, 2.0], [0.0; 3]);
        let body_from_other = pose([-1.0, 0.5, 1.8], [0.0, 0.6, 0.3]);
        // 1 m ahead and 0.1 rad to the left in 100 ms, starting at 2 s.
        let motion = SweepMotion {
            mid: pose([5.0, 1.0, 2.0], [0.0, 0.0, 0.4]),
            translation: Vector3::new(1.0, 0.2, 0.0),
            rotation: Vector3::new(0.0, 0.0, 0.1),
        };
        let first = Registered {
            stamp: Stamp(2_000_000_000),
            duration_nanos: 100_000_000,
            motion,
            path: Vec::new(),
            matched: None,
            contrast: None,
            predicted_by: crate::PredictionSources::default(),
            by_lidar: motion.mid,
            map_restarted: false,
            covariance: Matrix6::zeros(),
            moving: Vec::new(),
        };
        let point = |offset_nanos| TimedPoint { position: [5.0, 0.0, 0.0], offset_nanos, ring: 0 };
        let sweep = Sweep::new(Stamp(2_025_000_000), vec![point(0), point(50_000_000)], 16);
        let found = SecondaryLidar::new(&body_from_first, &body_from_other).follow(&sweep, &first);
        for (share, of_first) in [(-0.5, -0.25), (0.0, 0.0), (0.5, 0.25)] {
            let expected = motion.at(of_first) * body_from_first.inverse() * body_from_other;
            let error = expected.inverse() * found.motion.at(share);
            // The path of a lever of 1.1 m is an arc.
            assert!(error.translation.vector.norm() < 4e-4 && error.rotation.angle() < 1e-6, "{share}: {error}");
        }
        assert_eq!((found.stamp, found.duration_nanos), (Stamp(2_025_000_000), 50_000_000));
        assert!(found.moving.is_empty() && found.matched.is_none());
    }
}
