//! Topic `submap`: the registered, deskewed points of the next stretch of street. Written once; later stages publish
//! columns for it.

use crate::{MAX_LIDARS, Message, PoseError, PoseRow, RingCounts, pod};
#[cfg(feature = "geometry")]
use geometry::Pose;

/// Sweeps of one submap at most: 5 s at 20 Hz is 100; the table below is in every header, so it stays short.
pub const MAX_SWEEPS_PER_SUBMAP: usize = 256;

/// Bit of [`SubmapPoint::flags`]: the point is on a moving object.
pub const POINT_DYNAMIC: u8 = 1;

/// [`SubmapPoint::incidence`] where the surface around the point is unknown.
pub const POINT_INCIDENCE_UNKNOWN: u8 = 255;

pod! {
    /// One point, 28 bytes (the fields of thesis figure 2.23).
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `x y z` f32 | m, submap frame |
    /// | 12 | `offset_nanos` u32 | ns after the stamp of its sweep |
    /// | 16 | `azimuth` u16 | scan angle, 0.01 deg |
    /// | 18 | `elevation` i16 | vertical laser angle, 0.01 deg, up positive |
    /// | 20 | `sweep_idx` u16 | row of [`SubmapHeader::sweeps`]: frame, sensor position |
    /// | 22 | `intensity` u8 | raw |
    /// | 23 | `ring` u8 | laser, 0 = lowest |
    /// | 24 | `incidence` u8 | cosine of ray and surface normal, 0 to 254 = 0 to 1; 255 = unknown |
    /// | 25 | `flags` u8 | [`POINT_DYNAMIC`] |
    /// | 26 | `reserved` u16 | zero |
    pub struct SubmapPoint {
        /// m, submap frame.
        pub x: f32,
        /// m, submap frame.
        pub y: f32,
        /// m, submap frame.
        pub z: f32,
        /// ns after the stamp of its sweep.
        pub offset_nanos: u32,
        /// Raw encoder angle, 0.01 deg, 0 to 35999.
        pub azimuth: u16,
        /// Vertical angle of the beam, 0.01 deg.
        pub elevation: i16,
        /// Row of [`SubmapHeader::sweeps`].
        pub sweep_idx: u16,
        /// Raw strength of the return.
        pub intensity: u8,
        /// Beam, 0 = lowest.
        pub ring: u8,
        /// Cosine of the angle between ray and normal, 0 to 254 for 0 to 1.
        pub incidence: u8,
        /// Bits: [`POINT_DYNAMIC`].
        pub flags: u8,
        /// Zero.
        pub reserved: u16,
    }
}

pod! {
    /// One sweep of one LiDAR inside a submap, 88 bytes. Its points are `first_point .. first_point + n_points`.
    pub struct SubmapSweep {
        /// ns since the Unix epoch, first shot.
        pub stamp: i64,
        /// Number of the sweep in the drive; with several LiDARs, among the sweeps of all.
        pub seq: u64,
        /// ns from first to last shot.
        pub duration_nanos: u32,
        /// Index of its first point.
        pub first_point: u32,
        /// How many points.
        pub n_points: u32,
        /// Index of the LiDAR, as in topic `sweep`.
        pub lidar: u32,
        /// Lidar position and rotation (x y z, qx qy qz qw) in the submap frame at the first shot.
        pub submap_from_lidar_begin: [f32; 7],
        /// Lidar pose in the submap frame at the last shot. Between first and last shot, positions are interpolated
        /// linearly and rotations by slerp.
        pub submap_from_lidar_end: [f32; 7],
    }
}

pod! {
    /// Data of the whole submap. The envelope's seq is the submap's number; its stamp is the stamp of the first shot.
    pub struct SubmapHeader {
        /// ns since the Unix epoch, first shot.
        pub stamp_begin: i64,
        /// ns since the Unix epoch, last shot.
        pub stamp_end: i64,
        /// Pose of the submap in odom, m: position and heading of the body at the first shot, z axis parallel to the z
        /// axis of odom. Topic `placement` holds its pose in the world.
        pub odom_from_submap: PoseRow,
        /// Smallest x y z, m, submap frame.
        pub min: [f32; 3],
        /// Largest x y z, m, submap frame.
        pub max: [f32; 3],
        /// Rows of `sweeps` in use.
        pub n_sweeps: u32,
        /// Rings of the first LiDAR.
        pub n_rings: u32,
        /// Rings of the other LiDARs; 0 for those without points.
        pub n_rings_of_others: [u32; MAX_LIDARS - 1],
        /// LiDARs of the vehicle; 0 counts as one.
        pub n_lidars: u32,
        /// The sweeps that make up the submap.
        pub sweeps: [SubmapSweep; MAX_SWEEPS_PER_SUBMAP],
    }
}

/// A pose in the format of [`SubmapSweep`]: x y z, qx qy qz qw.
#[cfg(feature = "geometry")]
pub fn pose_numbers(pose: &Pose) -> [f32; 7] {
    let t = pose.translation.vector;
    let q = pose.rotation.coords;
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|value| value as f32)
}

/// Error of a submap whose content breaks a rule of the topic.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SubmapError {
    /// [`SubmapHeader::odom_from_submap`] is not a rigid transform.
    #[error("submap {seq}: odom_from_submap: {source}")]
    Pose {
        /// Number of the submap.
        seq: u64,
        /// Error with the numbers of the pose.
        source: PoseError,
    },
    /// [`SubmapHeader::n_sweeps`] exceeds the table.
    #[error("submap {seq}: {n_sweeps} sweeps; at most {MAX_SWEEPS_PER_SUBMAP} are allowed")]
    Sweeps {
        /// Number of the submap.
        seq: u64,
        /// The number of sweeps found.
        n_sweeps: u32,
    },
    /// [`SubmapPoint::sweep_idx`] is not a row of the table.
    #[error("submap {seq}: point {point} is of sweep {sweep_idx}; the header has {n_sweeps}")]
    Point {
        /// Number of the submap.
        seq: u64,
        /// Index of the point.
        point: usize,
        /// The index found.
        sweep_idx: u16,
        /// Sweeps of the submap.
        n_sweeps: usize,
    },
}

/// A [`SubmapHeader`] that has been checked.
#[derive(Clone, Copy, Debug)]
pub struct CheckedSubmap<'a> {
    /// Number of the submap.
    pub seq: u64,
    /// Pose of the submap in odom, m.
    #[cfg(feature = "geometry")]
    pub odom_from_submap: Pose,
    /// The sweeps in use.
    pub sweeps: &'a [SubmapSweep],
}

impl SubmapHeader {
    /// The header of a submap of one sweep, 0.1 s, of a LiDAR that stands at the origin of the submap and of odom.
    pub fn one_sweep(n_points: usize, n_rings: usize) -> Box<Self> {
        const HERE: [f32; 7] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let odom_from_submap = PoseRow { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
        let mut header = Box::new(Self { odom_from_submap, n_rings: n_rings as u32, n_sweeps: 1, ..Self::default() });
        header.sweeps[0] = SubmapSweep {
            n_points: n_points as u32,
            duration_nanos: 100_000_000,
            submap_from_lidar_begin: HERE,
            submap_from_lidar_end: HERE,
            ..SubmapSweep::default()
        };
        header
    }
    /// Rings of all LiDARs.
    pub fn ring_counts(&self) -> RingCounts {
        RingCounts::new(self.n_rings, self.n_rings_of_others)
    }
    /// Checks pose and number of sweeps. `seq` is the submap's number, for the error.
    pub fn checked(&self, seq: u64) -> Result<CheckedSubmap<'_>, SubmapError> {
        self.odom_from_submap.check().map_err(|source| SubmapError::Pose { seq, source })?;
        #[cfg(feature = "geometry")]
        let odom_from_submap = self.odom_from_submap.checked().map_err(|source| SubmapError::Pose { seq, source })?;
        let sweeps = self.sweeps.get(..self.n_sweeps as usize);
        let sweeps = sweeps.ok_or(SubmapError::Sweeps { seq, n_sweeps: self.n_sweeps })?;
        Ok(CheckedSubmap {
            seq,
            #[cfg(feature = "geometry")]
            odom_from_submap,
            sweeps,
        })
    }
}

impl CheckedSubmap<'_> {
    /// Checks that every point belongs to a sweep of the header.
    pub fn check_points(&self, points: &[SubmapPoint]) -> Result<(), SubmapError> {
        let seq = self.seq;
        let n_sweeps = self.sweeps.len();
        match points.iter().position(|point| usize::from(point.sweep_idx) >= n_sweeps) {
            None => Ok(()),
            Some(point) => Err(SubmapError::Point { seq, point, sweep_idx: points[point].sweep_idx, n_sweeps }),
        }
    }
}

/// A finished stretch of street in its own frame.
pub struct SubmapTopic;
impl Message for SubmapTopic {
    const TOPIC: &'static str = "submap";
    const VERSION: u32 = 2;
    // One in work at the consumer and one waiting keep both sides busy; each is tens of MB.
    const QUEUE: usize = 2;
    // One in work and the previous one, for consumers that match across the border.
    const BORROWED: usize = 2;
    // 5 s of an HDL-32E are 3.5 million points, of an HDL-64E 6.7 million.
    const MAX_ROWS: usize = 1 << 23;
    type Header = SubmapHeader;
    type Row = SubmapPoint;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(n_sweeps: u32) -> SubmapHeader {
        let odom_from_submap = PoseRow { translation: [1.0, 2.0, 3.0], rotation: [0.0, 0.0, 0.0, 1.0] };
        SubmapHeader { odom_from_submap, n_sweeps, ..SubmapHeader::default() }
    }

    #[test]
    fn checked_header_returns_pose_and_sweeps_in_use() {
        let header = header(3);
        let checked = header.checked(7).expect("is sound");
        assert_eq!((checked.sweeps.len(), checked.odom_from_submap.translation.z), (3, 3.0));
        let mut points = vec![SubmapPoint { sweep_idx: 2, ..SubmapPoint::default() }; 5];
        assert_eq!(checked.check_points(&points), Ok(()));
        points[4].sweep_idx = 3;
        let error = checked.check_points(&points).expect_err("there is no sweep 3");
        assert_eq!(error.to_string(), "submap 7: point 4 is of sweep 3; the header has 3");
    }

    #[test]
    fn checked_header_with_bad_pose_or_too_many_sweeps_is_refused() {
        let mut bent = header(3);
        bent.odom_from_submap.rotation[3] = 2.0;
        let error = bent.checked(7).expect_err("the quaternion's norm is 2").to_string();
        assert!(
            error.starts_with("submap 7: odom_from_submap: ") && error.contains("is not a rigid transform"),
            "{error}"
        );
        let error = header(257).checked(7).expect_err("the table has 256 rows");
        assert_eq!(error.to_string(), "submap 7: 257 sweeps; at most 256 are allowed");
    }
}
