//! Topic `trajectory`: the poses of the vehicle in odom, before the placement.

use crate::{Message, TickTopic, pod, raw::NoHeader};
#[cfg(feature = "geometry")]
use geometry::{Isometry3, Pose, Quaternion, Translation3, UnitQuaternion};

pod! {
    /// A rigid transform: translation in m, unit quaternion x y z w.
    pub struct PoseRow {
        /// x y z, m.
        pub translation: [f64; 3],
        /// x y z w, norm 1.
        pub rotation: [f64; 4],
    }
}

#[cfg(feature = "geometry")]
impl From<Pose> for PoseRow {
    fn from(pose: Pose) -> Self {
        let q = pose.rotation.coords;
        Self { translation: pose.translation.vector.into(), rotation: [q.x, q.y, q.z, q.w] }
    }
}

/// Error of a pose that is not a rigid transform.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "translation {translation:?}, rotation {rotation:?} is not a rigid transform: all numbers must be finite and the quaternion (x y z w) of norm 1"
)]
pub struct PoseError {
    /// The translation found, m.
    pub translation: [f64; 3],
    /// The rotation found, x y z w.
    pub rotation: [f64; 4],
}

impl PoseRow {
    /// Whether it is a rigid transform: all numbers are finite, and the quaternion's norm is 1 within 1e-6. The error shows the numbers.
    pub fn check(&self) -> Result<(), PoseError> {
        let Self { translation, rotation } = *self;
        let norm = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
        let is_rigid = translation.iter().all(|v| v.is_finite()) && (norm - 1.0).abs() < 1e-6;
        if is_rigid { Ok(()) } else { Err(PoseError { translation, rotation }) }
    }

    /// The transform, as [`PoseRow::to_pose`]; the error shows the numbers.
    #[cfg(feature = "geometry")]
    pub fn checked(&self) -> Result<Pose, PoseError> {
        self.check()?;
        let [x, y, z, w] = self.rotation;
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        Ok(Isometry3::from_parts(Translation3::from(self.translation), rotation))
    }

    /// The transform, if [`PoseRow::check`] accepts the numbers. Their bits are kept as they are.
    #[cfg(feature = "geometry")]
    pub fn to_pose(&self) -> Option<Pose> {
        self.checked().ok()
    }
}

pod! {
    /// Pose of the body in odom at a stamp.
    pub struct StampedPose {
        /// ns since the Unix epoch.
        pub stamp: i64,
        /// Pose of the body in odom, m. Odom is the body frame at the first shot of the drive; it drifts.
        pub odom_from_body: PoseRow,
    }
}

/// The poses of the sweeps registered in the tick: two for each sweep, at its first and its last shot. Stamps never
/// decrease. The poses of the first sweep are published with the poses of the second, because a speed needs two sweeps.
pub struct TrajectoryTopic;
impl Message for TrajectoryTopic {
    const TOPIC: &'static str = "trajectory";
    const VERSION: u32 = 1;
    // One message per sweep: as many as ticks. A message has 200 bytes.
    const QUEUE: usize = TickTopic::QUEUE;
    const BORROWED: usize = 4;
    // Two poses per sweep; a tick has one sweep, the second tick two.
    const MAX_ROWS: usize = 1 << 12;
    const FINITE_ROWS: bool = true;
    type Header = NoHeader;
    type Row = StampedPose;
}
