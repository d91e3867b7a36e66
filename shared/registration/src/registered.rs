//! The result of registering a sweep.

use crate::prediction::navigation::PredictionSources;
use crate::{Matched, SweepMotion};
use geometry::{Pose, Stamp};
use nalgebra::Matrix6;

/// A registered sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Registered {
    /// Time of the first shot.
    pub stamp: Stamp,
    /// ns from first to last shot.
    pub duration_nanos: u32,
    /// `odom_from_lidar` over the sweep.
    pub motion: SweepMotion,
    /// `odom_from_lidar` at evenly spaced times from first to last shot, if the poses are given: points are deskewed by
    /// them. Otherwise empty: the motion is uniform.
    pub path: Vec<Pose>,
    /// The match; `None` if no match was accepted. Then the motion is the prediction, or rest for a first sweep that
    /// could not be matched to a second one.
    pub matched: Option<Matched>,
    /// How well the scene constrains the along-track position: the cost of other positions along the track minus the
    /// cost of the match. 0.15 to 0.75 in streets, about 0 if the match follows a queue around the vehicle. `None`
    /// without a match, or if too few surfaces face along the track.
    pub contrast: Option<f64>,
    /// Sensors that predicted the motion. Along degenerate directions the prediction is the result.
    pub predicted_by: PredictionSources,
    /// `odom_from_lidar` in the middle of the sweep by the match alone: without the weight that the inertial samples had in it.
    pub by_lidar: Pose,
    /// Whether a new map begins with this sweep because too many sweeps had no match.
    pub map_restarted: bool,
    /// Covariance of the pose in the middle of the sweep: translation (m), then rotation (rad), in odom axes about the
    /// LiDAR. It is zero at the first sweep and grows slowly with each match, quickly along degenerate directions.
    pub covariance: Matrix6<f64>,
    /// Indices of points on moving objects, ascending: points in space that rays of an earlier sweep passed. Objects
    /// that have just come into view are not detected.
    pub moving: Vec<u32>,
}

impl Registered {
    /// `odom_from_lidar` at the first shot.
    pub fn begin(&self) -> Pose {
        self.motion.begin()
    }
    /// `odom_from_lidar` at the last shot.
    pub fn end(&self) -> Pose {
        self.motion.end()
    }
    /// Time of the last shot.
    pub fn end_stamp(&self) -> Stamp {
        self.stamp.plus_nanos(i64::from(self.duration_nanos))
    }
    /// Names and values of the run's counters.
    pub fn counts(&self) -> [(&'static str, u64); 4] {
        let is_degenerate = self.matched.as_ref().is_some_and(|matched| matched.n_degenerate_directions > 0);
        [
            ("sweeps_bridged", u64::from(self.is_bridged())),
            ("degenerate_sweeps", u64::from(is_degenerate)),
            ("maps_restarted", u64::from(self.map_restarted)),
            ("points_moving", self.moving.len() as u64),
        ]
    }
    /// Whether the poses are given by a post-processed trajectory.
    pub fn is_given(&self) -> bool {
        !self.path.is_empty()
    }
    /// Whether the prediction replaces a match.
    pub fn is_bridged(&self) -> bool {
        self.matched.is_none() && !self.is_given()
    }
}

/// Reason why a sweep cannot be registered.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RegistrationError {
    /// The sweep is not later than the previous one.
    #[error("sweep with middle {got} follows one with middle {last}: sweeps must be in the order of time")]
    Order {
        /// Middle of the previous sweep.
        last: Stamp,
        /// Middle of this sweep.
        got: Stamp,
    },
    /// The given poses do not cover the sweep.
    #[error("the given path has no pose for the sweep at {stamp}")]
    NoPose {
        /// First shot of the sweep.
        stamp: Stamp,
    },
}
