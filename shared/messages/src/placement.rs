//! Topic `placement`: the poses of the submaps after loop closure. Points stay in their submaps; only the submaps move.

use crate::{Message, PoseRow, SubmapTopic, TrajectoryTopic, pod};

/// [`PlacementHeader::frame`]: the world frame is the pose of the vehicle at the first shot: its position and heading.
/// Its z axis points up if gravity was measured, otherwise it is the z axis of odom.
pub const FRAME_LOCAL: u32 = 0;
/// [`PlacementHeader::frame`]: the axes of the world are east, north and up; its origin is in the header.
pub const FRAME_EAST_NORTH_UP: u32 = 1;

pod! {
    /// The pose of one submap, 152 bytes.
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `submap` u64 | seq of the submap |
    /// | 8 | `stamp` i64 | ns since the Unix epoch, its first shot |
    /// | 16 | `world_from_submap` 7 f64 | m; unit quaternion x y z w |
    /// | 72 | `odom_from_submap` 7 f64 | pose in the submap's header |
    /// | 128 | `sigma_m` 3 f32 | standard deviation along the submap's x y z, m |
    /// | 140 | `sigma_rad` 3 f32 | standard deviation of the rotation about the submap's x y z, rad |
    pub struct PlacementRow {
        /// Number of the submap.
        pub submap: u64,
        /// ns since the Unix epoch, first shot of the submap.
        pub stamp: i64,
        /// Replaces the pose in the submap's header.
        pub world_from_submap: PoseRow,
        /// The pose in the submap's header; topic `trajectory` is in its frame.
        pub odom_from_submap: PoseRow,
        /// Standard deviation of the position along the submap's axes, m.
        pub sigma_m: [f32; 3],
        /// Standard deviation of the rotation about the submap's axes, rad.
        pub sigma_rad: [f32; 3],
    }
}

pod! {
    /// Data of all rows, 48 bytes.
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `latitude_deg` f64 | WGS84, of the world's origin; 0 if the world has no geographic origin |
    /// | 8 | `longitude_deg` f64 | as for `latitude_deg` |
    /// | 16 | `altitude_m` f64 | above the ellipsoid |
    /// | 24 | `frame` u32 | [`FRAME_LOCAL`] or [`FRAME_EAST_NORTH_UP`] |
    /// | 28 | `n_loops` u32 | accepted loop closures |
    /// | 32 | `n_loops_refused` u32 | rejected loop closures |
    /// | 36 | `n_fixes` u32 | accepted fixes |
    /// | 40 | `n_fixes_refused` u32 | rejected fixes |
    /// | 44 | `n_uprights` u32 | submaps in which gravity was measured |
    pub struct PlacementHeader {
        /// Latitude of the world's origin, WGS84, degrees; 0 if the world has no geographic origin.
        pub latitude_deg: f64,
        /// Longitude of the world's origin, WGS84, degrees; 0 if the world has no geographic origin.
        pub longitude_deg: f64,
        /// Height of the world's origin above the ellipsoid, m.
        pub altitude_m: f64,
        /// [`FRAME_LOCAL`] or [`FRAME_EAST_NORTH_UP`].
        pub frame: u32,
        /// Accepted loop closures.
        pub n_loops: u32,
        /// Rejected loop closures.
        pub n_loops_refused: u32,
        /// Accepted fixes.
        pub n_fixes: u32,
        /// Rejected fixes.
        pub n_fixes_refused: u32,
        /// Submaps in which gravity was measured.
        pub n_uprights: u32,
    }
}

/// Standard deviations of a pose in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseDeviation {
    /// Horizontal position, m: root of the sum of the squares along both axes.
    pub position_m: f64,
    /// Height, m.
    pub height_m: f64,
    /// Heading, degrees; at most 180.
    pub heading_deg: f64,
}

impl PoseDeviation {
    /// The larger of both deviations, for each component.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            position_m: self.position_m.max(other.position_m),
            height_m: self.height_m.max(other.height_m),
            heading_deg: self.heading_deg.max(other.heading_deg),
        }
    }
}

impl PlacementRow {
    /// Standard deviations in the world frame. A submap is not tilted: its z axis is vertical.
    pub fn deviation(&self) -> PoseDeviation {
        let [x, y, z] = self.sigma_m.map(f64::from);
        let heading_deg = f64::from(self.sigma_rad[2]).to_degrees().min(180.0);
        PoseDeviation { position_m: x.hypot(y), height_m: z, heading_deg }
    }
}

/// The poses of all submaps of the drive, published once at the end of the stream, in the order of the submaps.
pub struct PlacementTopic;

impl PlacementTopic {
    /// Topics in the odom frame. Without `placement` they cannot be moved to the world frame.
    pub const MOVES: [&str; 2] = [SubmapTopic::TOPIC, TrajectoryTopic::TOPIC];
}

impl Message for PlacementTopic {
    const TOPIC: &'static str = "placement";
    const VERSION: u32 = 1;
    const QUEUE: usize = 2;
    const BORROWED: usize = 1;
    // 1300 km in pieces of 20 m, or 90 hours in pieces of 5 s.
    const MAX_ROWS: usize = 1 << 16;
    const FINITE_ROWS: bool = true;
    type Header = PlacementHeader;
    type Row = PlacementRow;
}
