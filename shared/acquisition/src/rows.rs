//! Rows of messages from decoded sentences.

use formats::nmea::Fix;
use messages::GnssRow;

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
        reserved: 0,
    })
}
