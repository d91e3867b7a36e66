//! Livox `CustomMsg` (`livox_ros_driver`, `livox_ros_driver2`).

use super::RawPoint;
use crate::ros::cursor::{Cursor, MessageFault};
use crate::ros::messages::Header;

/// Header and points. Times are ns after the header's stamp.
pub(crate) fn livox_points(c: &mut Cursor<'_>) -> Result<(Header, Vec<RawPoint>), MessageFault> {
    let header = Header::read(c)?;
    c.u64("timebase")?;
    c.u32("point_num")?;
    c.u8("lidar_id")?;
    c.bytes("rsvd", 3)?;
    // A time, three coordinates and three bytes.
    let n = c.length("points", 19)?;
    let one = |c: &mut Cursor<'_>| {
        let time = Some(f64::from(c.u32("points.offset_time")?));
        let position = [c.f32("points.x")?, c.f32("points.y")?, c.f32("points.z")?].map(f64::from);
        let intensity = f32::from(c.u8("points.reflectivity")?);
        let _tag = c.u8("points.tag")?;
        let _line = c.u8("points.line")?;
        Ok(RawPoint { position, intensity, ring: None, time })
    };
    let points = (0..n).map(|_| one(c)).collect::<Result<Vec<_>, _>>()?;
    Ok((header, points))
}
