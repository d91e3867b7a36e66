//! Topic `placement`: where submaps lie once everything has been seen. Points stay in their submaps; this moves the submaps.

use crate::{Message, PoseRow, pod};

/// [`PlacementHeader::frame`]: the world is the vehicle's place and heading at the first shot, z up.
pub const FRAME_LOCAL: u32 = 0;
/// [`PlacementHeader::frame`]: the world is east, north and up around the origin in the header.
pub const FRAME_EAST_NORTH_UP: u32 = 1;

pod! {
    /// One submap in its place, 152 bytes.
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `submap` u64 | seq of the submap |
    /// | 8 | `stamp` i64 | ns since the Unix epoch, its first shot |
    /// | 16 | `world_from_submap` 7 f64 | m; unit quaternion x y z w |
    /// | 72 | `odom_from_submap` 7 f64 | where its header says it is |
    /// | 128 | `sigma_m` 3 f32 | standard deviation along the submap's x y z, m |
    /// | 140 | `sigma_rad` 3 f32 | standard deviation of turns about the submap's x y z, rad |
    pub struct PlacementRow {
        /// Number of the submap.
        pub submap: u64,
        /// ns since the Unix epoch, first shot of the submap.
        pub stamp: i64,
        /// Takes the place of the one in the submap's header.
        pub world_from_submap: PoseRow,
        /// The one in the submap's header, in whose frame topic `trajectory` is.
        pub odom_from_submap: PoseRow,
        /// Standard deviation of the position along the submap's axes, m.
        pub sigma_m: [f32; 3],
        /// Standard deviation of the rotation about the submap's axes, rad.
        pub sigma_rad: [f32; 3],
    }
}

pod! {
    /// What holds for all rows, 48 bytes.
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `latitude_deg` f64 | WGS84, of the world's origin; 0 without |
    /// | 8 | `longitude_deg` f64 | the same |
    /// | 16 | `altitude_m` f64 | above the ellipsoid |
    /// | 24 | `frame` u32 | [`FRAME_LOCAL`] or [`FRAME_EAST_NORTH_UP`] |
    /// | 28 | `n_loops` u32 | closed loops that are believed |
    /// | 32 | `n_loops_refused` u32 | closed loops that do not fit the rest |
    /// | 36 | `n_fixes` u32 | fixes that are believed |
    /// | 40 | `n_fixes_refused` u32 | fixes that do not fit the rest |
    /// | 44 | `n_uprights` u32 | submaps in which gravity was measured |
    pub struct PlacementHeader {
        /// WGS84, degrees, of the world's origin; 0 without.
        pub latitude_deg: f64,
        /// WGS84, degrees, of the world's origin; 0 without.
        pub longitude_deg: f64,
        /// Above the ellipsoid, m.
        pub altitude_m: f64,
        /// [`FRAME_LOCAL`] or [`FRAME_EAST_NORTH_UP`].
        pub frame: u32,
        /// Closed loops that are believed.
        pub n_loops: u32,
        /// Closed loops that do not fit the rest.
        pub n_loops_refused: u32,
        /// Fixes that are believed.
        pub n_fixes: u32,
        /// Fixes that do not fit the rest.
        pub n_fixes_refused: u32,
        /// Submaps in which gravity was measured.
        pub n_uprights: u32,
    }
}

/// All submaps of the drive in their places; published once, at the end of the stream. The rows are in the order of the
/// submaps.
pub struct Placement;
impl Message for Placement {
    const TOPIC: &'static str = "placement";
    const VERSION: u32 = 1;
    const QUEUE: usize = 2;
    const BORROWED: usize = 1;
    // 1300 km in pieces of 20 m, or 90 hours in pieces of 5 s.
    const MAX_ROWS: usize = 1 << 16;
    type Header = PlacementHeader;
    type Row = PlacementRow;
}
