//! Topic `trajectory`: where the vehicle was.

use crate::{Message, pod, raw::NoHeader};
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

impl From<Pose> for PoseRow {
    fn from(pose: Pose) -> Self {
        let q = pose.rotation.coords;
        Self { translation: pose.translation.vector.into(), rotation: [q.x, q.y, q.z, q.w] }
    }
}

impl PoseRow {
    /// `None` unless all numbers are finite and the quaternion's norm is 1 within 1e-6. The bits are kept as they are.
    pub fn to_pose(&self) -> Option<Pose> {
        let [x, y, z, w] = self.rotation;
        let quaternion = Quaternion::new(w, x, y, z);
        let sound = self.translation.iter().all(|v| v.is_finite()) && (quaternion.norm() - 1.0).abs() < 1e-6;
        sound.then(|| {
            Isometry3::from_parts(Translation3::from(self.translation), UnitQuaternion::new_unchecked(quaternion))
        })
    }
}

pod! {
    /// `world_from_body` at a stamp.
    pub struct StampedPose {
        /// ns since the Unix epoch.
        pub stamp: i64,
        /// `world_from_body`.
        pub world_from_body: PoseRow,
    }
}

/// The poses of the sweeps registered in the tick: for each the one at its first and at its last shot. Stamps never fall.
/// The first sweep's poses come with the second's, because a speed needs two.
pub struct Trajectory;
impl Message for Trajectory {
    const TOPIC: &'static str = "trajectory";
    const VERSION: u32 = 1;
    const QUEUE: usize = 8;
    const BORROWED: usize = 4;
    // Two poses per sweep; a tick has one sweep, the second tick two.
    const MAX_ROWS: usize = 1 << 12;
    type Header = NoHeader;
    type Row = StampedPose;
}
