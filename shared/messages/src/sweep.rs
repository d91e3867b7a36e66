//! Topic `sweep`: the points of one LiDAR revolution, in the moving lidar frame.
//!
//! The revolutions of the first LiDAR of a vehicle are the ticks. The points that its other LiDARs measure between the
//! start and the end of that revolution follow in the same tick, one message for each LiDAR, in the order of the LiDARs.

use crate::{Message, pod};

pod! {
    /// One return, 20 bytes. A pulse without a return has no row.
    ///
    /// | offset | field | unit |
    /// |---|---|---|
    /// | 0 | `x y z` f32 | m, lidar frame at the time of the shot |
    /// | 12 | `offset_nanos` u32 | ns after the sweep's stamp |
    /// | 16 | `azimuth` u16 | raw encoder angle, 0.01 deg, 0 to 35999, clockwise from +x of the lidar frame |
    /// | 18 | `intensity` u8 | as reported by the device |
    /// | 19 | `ring` u8 | 0 = lowest beam |
    pub struct SweepPoint {
        /// m, forward.
        pub x: f32,
        /// m, left.
        pub y: f32,
        /// m, up.
        pub z: f32,
        /// ns after the sweep's stamp; all zero if the recording has no point times.
        pub offset_nanos: u32,
        /// Raw encoder angle, 0.01 deg, 0 to 35999.
        pub azimuth: u16,
        /// Raw strength of the return.
        pub intensity: u8,
        /// Beam by elevation, 0 = lowest.
        pub ring: u8,
    }
}

pod! {
    /// Data of the whole sweep.
    pub struct SweepHeader {
        /// ns from the sweep's stamp to the end of the revolution.
        pub duration_nanos: u32,
        /// Packets missing inside the revolution, by their times.
        pub lost_packets: u32,
        /// Rings of the sensor.
        pub n_rings: u32,
        /// 1 if `offset_nanos` of the points is measured, 0 if the recording has no point times.
        pub has_times: u32,
        /// Index of the LiDAR in the drive, below [`MAX_LIDARS`]; 0 = the first LiDAR, which defines the ticks.
        pub lidar: u32,
    }
}

/// Maximum number of LiDARs of a vehicle: the sweeps of two ticks fit into the queue.
pub const MAX_LIDARS: usize = SweepTopic::QUEUE / 2;

/// One revolution. Its stamp is the stamp of its first shot.
pub struct SweepTopic;
impl Message for SweepTopic {
    const TOPIC: &'static str = "sweep";
    const VERSION: u32 = 2;
    const QUEUE: usize = 8;
    const BORROWED: usize = 4;
    // A decoder closes a sweep at the latest after some 600 000 returns: an HDL-64E in dual mode at 5 Hz, plus a margin.
    const MAX_ROWS: usize = 1 << 20;
    type Header = SweepHeader;
    type Row = SweepPoint;
}
