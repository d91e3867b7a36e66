//! Topics `image`, `mosaic`, `gnss` and `imu`: raw data of the other sensors.

use crate::{Message, pod};

pod! {
    /// No header beyond the envelope.
    pub struct NoHeader { /// Zero.
        pub reserved: u64 }
}

pod! {
    /// One exposure of one camera. Rows: `height * width * 3` bytes, sRGB, row-major from the top left.
    pub struct ImageHeader {
        /// Index into the rig's cameras.
        pub camera: u32,
        /// Columns.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// 3 = sRGB.
        pub channels: u32,
        /// Exposure time in ns; the stamp is its middle.
        pub exposure_nanos: u64,
    }
}

/// A color image.
pub struct ImageTopic;
impl Message for ImageTopic {
    const TOPIC: &'static str = "image";
    const VERSION: u32 = 1;
    // Six cameras at 1 Hz, bursts at least 0.95 s apart: four in 3 s, twice the longest step of `colorize`. 1.4 MB each in the
    // sample drive, 35 MB if all wait; 15 MB each for a Ladybug5, 360 MB.
    const QUEUE: usize = 24;
    // A submap lasts 5 s at most, at 1 Hz by six cameras, plus the burst before and after it, in both of two submaps.
    const BORROWED: usize = 96;
    // A raw Ladybug5 image has 2464 x 2048 x 3 bytes.
    const MAX_ROWS: usize = 1 << 25;
    type Header = ImageHeader;
    type Row = u8;
}

pod! {
    /// One raw exposure of a mosaic camera. Rows: `height * width` samples, row-major from the top left.
    pub struct MosaicHeader {
        /// Index into the rig's mosaic cameras.
        pub camera: u32,
        /// Columns.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// Samples are 0 to `2^bit_depth - 1`; the largest value means saturated.
        pub bit_depth: u32,
        /// Exposure time in ns; the stamp is its middle.
        pub exposure_nanos: u64,
    }
}

/// A raw mosaic image.
pub struct MosaicTopic;
impl Message for MosaicTopic {
    const TOPIC: &'static str = "mosaic";
    const VERSION: u32 = 1;
    // Two cameras fire in one tick; two such bursts may wait.
    const QUEUE: usize = 4;
    const BORROWED: usize = 4;
    // A mosaic camera has 2048 x 1088 pixels; the next generation has four times as many.
    const MAX_ROWS: usize = 1 << 24;
    type Header = MosaicHeader;
    type Row = u16;
}

pod! {
    /// One position fix (GGA and RMC of the same second joined), 72 bytes.
    pub struct GnssRow {
        /// ns since the Unix epoch.
        pub stamp: i64,
        /// Latitude, WGS84, degrees, north positive.
        pub latitude_deg: f64,
        /// Longitude, WGS84, degrees, east positive.
        pub longitude_deg: f64,
        /// Height above the ellipsoid, m.
        pub altitude_m: f64,
        /// Speed over ground, m/s; negative = unknown.
        pub speed_mps: f64,
        /// Course over ground, degrees clockwise from north; negative = unknown.
        pub course_deg: f64,
        /// Horizontal dilution of precision; 0 = unknown.
        pub hdop: f32,
        /// Satellites in use.
        pub satellites: u32,
        /// GGA quality: 0 none, 1 single, 2 differential, 4 fixed, 5 float.
        pub quality: u32,
        /// Vertical dilution of precision; 0 = unknown.
        pub vdop: f32,
        /// Standard deviation that the receiver states, along one horizontal axis, m; 0 = unknown.
        pub deviation_across_m: f32,
        /// Standard deviation that the receiver states, in height, m; 0 = unknown.
        pub deviation_up_m: f32,
    }
}

/// The fixes of one tick.
pub struct GnssTopic;
impl Message for GnssTopic {
    const TOPIC: &'static str = "gnss";
    const VERSION: u32 = 2;
    const QUEUE: usize = 8;
    const BORROWED: usize = 4;
    // One tick is a tenth of a second; receivers give 20 fixes per second at most, logs may contain duplicates.
    const MAX_ROWS: usize = 1 << 12;
    type Header = NoHeader;
    type Row = GnssRow;
}

pod! {
    /// One inertial sample in the body frame, 56 bytes.
    pub struct ImuRow {
        /// ns since the Unix epoch.
        pub stamp: i64,
        /// Specific force, m/s^2, x forward, y left, z up; at rest about (0, 0, 9.81).
        pub acceleration: [f64; 3],
        /// Angular rate, rad/s.
        pub angular_rate: [f64; 3],
    }
}

/// The inertial samples of one tick.
pub struct ImuTopic;
impl Message for ImuTopic {
    const TOPIC: &'static str = "imu";
    const VERSION: u32 = 1;
    const QUEUE: usize = 8;
    const BORROWED: usize = 4;
    // As for `gnss`, at 1 kHz, and a gap in the LiDAR of a minute.
    const MAX_ROWS: usize = 1 << 16;
    type Header = NoHeader;
    type Row = ImuRow;
}
