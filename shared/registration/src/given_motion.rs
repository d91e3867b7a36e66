//! The motion of sweeps from given poses: no sweep is matched.

use crate::moving_objects::MovingDetector;
use crate::{LocalMap, Registered, RegistrationError, Sweep, SweepMotion};
use geometry::{Pose, Stamp, Trajectory, interpolate};
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Poses of a sweep after the first: 1.6 ms apart at 10 Hz, finer than any inertial solution.
const N_STEPS: usize = 64;

/// The saved state, see [`GivenMotion::save`]. The poses themselves are not saved.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct GivenMotionState {
    last_mid: Option<Stamp>,
    moving: MovingDetector,
}

/// Registers sweeps by given poses.
#[derive(Debug)]
pub struct GivenMotion {
    odom_from_body: Arc<Trajectory>,
    body_from_lidar: Pose,
    state: GivenMotionState,
    /// Always empty: nothing is matched.
    map: LocalMap,
}

impl GivenMotion {
    /// Poses of the body, and the mounting of the LiDAR.
    pub fn new(odom_from_body: Arc<Trajectory>, body_from_lidar: Pose) -> Self {
        Self::load(odom_from_body, body_from_lidar, GivenMotionState::default())
    }
    /// Continues from a state of [`GivenMotion::save`].
    pub fn load(odom_from_body: Arc<Trajectory>, body_from_lidar: Pose, state: GivenMotionState) -> Self {
        Self { odom_from_body, body_from_lidar, state, map: LocalMap::default() }
    }
    /// The state on which the following sweeps depend.
    pub fn save(&self) -> GivenMotionState {
        self.state.clone()
    }
    pub(crate) fn map(&self) -> &LocalMap {
        &self.map
    }

    /// Registers the next sweep. The path must cover it.
    pub fn register(&mut self, sweep: &Sweep) -> Result<Registered, RegistrationError> {
        let mid = sweep.mid_stamp();
        if let Some(last) = self.state.last_mid.filter(|last| mid <= *last) {
            return Err(RegistrationError::Order { last, got: mid });
        }
        self.state.last_mid = Some(mid);
        let duration_nanos = sweep.duration_nanos();
        let pose_at = |step: usize| {
            let nanos = i64::from(duration_nanos) * step as i64 / N_STEPS as i64;
            Some(self.odom_from_body.at(sweep.stamp().plus_nanos(nanos))? * self.body_from_lidar)
        };
        let path: Option<Vec<Pose>> = (0..=N_STEPS).map(pose_at).collect();
        let path = path.ok_or(RegistrationError::NoPose { stamp: sweep.stamp() })?;
        let motion = motion_between(&path[0], &path[N_STEPS]);
        let found = self.state.moving.detect(sweep, &motion);
        self.state.moving.add_sweep(sweep, &motion, &found);
        Ok(Registered {
            stamp: sweep.stamp(),
            duration_nanos,
            motion,
            path,
            matched: None,
            contrast: None,
            predicted_by: crate::PredictionSources::default(),
            by_lidar: motion.mid,
            map_restarted: false,
            covariance: Matrix6::zeros(),
            moving: found.points,
        })
    }
}

/// The uniform motion between two poses.
pub(crate) fn motion_between(begin: &Pose, end: &Pose) -> SweepMotion {
    SweepMotion {
        mid: interpolate(begin, end, 0.5),
        translation: end.translation.vector - begin.translation.vector,
        rotation: (begin.rotation.inverse() * end.rotation).scaled_axis(),
    }
}

/// The pose at a share of a sweep, 0 first to 1 last shot, from evenly spaced poses. Shares outside continue the motion at
/// that end.
pub(crate) fn pose_on(path: &[Pose], share: f64) -> Pose {
    let at = share * (path.len() - 1) as f64;
    let before = (at.floor().max(0.0) as usize).min(path.len() - 2);
    interpolate(&path[before], &path[before + 1], at - before as f64)
}
