//! Rows and headers of messages from decoded data.

use drive::SweepInfo;
use geometry::Stamp;
use lidar::SliceInfo;
use lidar::nmea::Fix;
use messages::{GnssRow, SweepHeader};

/// Header of a message with the returns of a secondary LiDAR.
#[derive(Clone, Copy, Debug)]
pub struct StampedHeader {
    /// The header.
    pub header: SweepHeader,
    /// Stamp of the message.
    pub stamp: i64,
}

/// The header of a sweep of a LiDAR with this number of rings, 0 without rings.
pub fn sweep_header(sweep: &SweepInfo, n_rings: usize) -> SweepHeader {
    SweepHeader {
        duration_nanos: sweep.duration_nanos,
        lost_packets: sweep.lost_packets.min(u64::from(u32::MAX)) as u32,
        n_rings: n_rings as u32,
        has_times: u32::from(sweep.has_times),
        lidar: 0,
    }
}

/// The header of a sweep of a secondary LiDAR, from its first shot to `end`, ns since the epoch.
pub fn slice_header(slice: &SliceInfo, stamp: Stamp, end: i64, lidar: usize, n_rings: usize) -> SweepHeader {
    SweepHeader {
        duration_nanos: (end - stamp.0).clamp(0, i64::from(u32::MAX)) as u32,
        lost_packets: slice.lost_packets.min(u64::from(u32::MAX)) as u32,
        n_rings: n_rings as u32,
        has_times: u32::from(slice.has_times),
        lidar: lidar as u32,
    }
}

/// The row of a fix; `None` without a height.
pub fn gnss_row(fix: &Fix) -> Option<GnssRow> {
    Some(GnssRow {
        stamp: fix.stamp.0,
        latitude_deg: fix.position_deg[0],
        longitude_deg: fix.position_deg[1],
        altitude_m: fix.altitude_m?,
        speed_mps: fix.speed_mps.unwrap_or(-1.0),
        course_deg: fix.course_deg.unwrap_or(-1.0),
        hdop: fix.hdop.unwrap_or_default() as f32,
        satellites: fix.satellites,
        quality: fix.quality,
        vdop: fix.vdop.unwrap_or_default() as f32,
        deviation_across_m: fix.deviation.map_or(0.0, |deviation| deviation.across_m) as f32,
        deviation_up_m: fix.deviation.map_or(0.0, |deviation| deviation.up_m) as f32,
    })
}
