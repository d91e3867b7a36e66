//! Positions of points and of the lidar in the frame of the odometry.

use crate::error::DeliveryError;
use geometry::{Point3, Pose, Vector3};
use messages::{CheckedSubmap, SubmapHeader, SubmapPoint, SubmapSweep};

/// Pose of a submap and the paths of the lidar during its sweeps.
pub(crate) struct SubmapGeometry {
    odom_from_submap: Pose,
    sweeps: Vec<SweepPath>,
}

/// Path of the lidar during a sweep: a line from its first to its last shot.
pub(crate) struct SweepPath {
    begin: Vector3<f64>,
    /// Velocity, m per ns.
    velocity: Vector3<f64>,
    stamp: i64,
    /// Number of the sweep in the drive.
    pub(crate) seq: i32,
    /// Index of the lidar.
    pub(crate) lidar: u8,
}

impl SubmapGeometry {
    /// Checks the submap.
    pub(crate) fn new(seq: u64, header: &SubmapHeader, points: &[SubmapPoint]) -> Result<Self, DeliveryError> {
        let checked = header.checked(seq)?;
        checked.check_points(points)?;
        let CheckedSubmap { odom_from_submap, sweeps, .. } = checked;
        let path = |sweep: &SubmapSweep| {
            let number = i32::try_from(sweep.seq);
            let number = number
                .map_err(|_| DeliveryError::ExceedsInt { what: format!("submap {seq}: sweep number {}", sweep.seq) })?;
            Ok::<_, DeliveryError>(SweepPath::new(sweep, number, &odom_from_submap))
        };
        Ok(Self { sweeps: sweeps.iter().map(path).collect::<Result<_, DeliveryError>>()?, odom_from_submap })
    }

    /// Position of `point` in odom, m.
    #[inline]
    pub(crate) fn position(&self, point: &SubmapPoint) -> Point3<f64> {
        self.odom_from_submap * Point3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z))
    }

    /// The sweep of `point`, which [`SubmapGeometry::new`] has checked.
    #[inline]
    pub(crate) fn sweep(&self, point: &SubmapPoint) -> &SweepPath {
        &self.sweeps[usize::from(point.sweep_idx)]
    }
}

impl SweepPath {
    fn new(sweep: &SubmapSweep, seq: i32, odom_from_submap: &Pose) -> Self {
        let position = |pose: &[f32; 7]| {
            let p = Point3::new(f64::from(pose[0]), f64::from(pose[1]), f64::from(pose[2]));
            (odom_from_submap * p).coords
        };
        let begin = position(&sweep.submap_from_lidar_begin);
        let moved = position(&sweep.submap_from_lidar_end) - begin;
        // A sweep of one shot has no duration and no motion.
        let velocity = moved / f64::from(sweep.duration_nanos.max(1));
        Self { begin, velocity, stamp: sweep.stamp, seq, lidar: sweep.lidar as u8 }
    }

    /// Position of the lidar at a time after the stamp of the sweep.
    #[inline]
    pub(crate) fn lidar_position(&self, offset_nanos: u32) -> Vector3<f64> {
        self.begin + self.velocity * f64::from(offset_nanos)
    }

    /// Seconds since the Unix epoch. f64 resolves 0.24 µs there, a fifth of the time between two shots.
    #[inline]
    pub(crate) fn time_s(&self, offset_nanos: u32) -> f64 {
        let nanos = self.stamp.saturating_add(i64::from(offset_nanos));
        nanos.div_euclid(1_000_000_000) as f64 + nanos.rem_euclid(1_000_000_000) as f64 * 1e-9
    }
}
