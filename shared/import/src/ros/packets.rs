//! Messages with raw packets of a LiDAR.

use super::cursor::{Cursor, MessageFault};
use super::messages::Header;

/// Layout of the packets of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PacketsKind {
    /// `velodyne_msgs/VelodyneScan`: packets of 1206 bytes.
    Velodyne,
    /// `pandar_msgs/PandarScan`, also `hesai_lidar`: buffers of 1500 bytes and the sizes of their packets.
    Pandar,
    /// `nebula_msgs/NebulaPackets`: packets of any size.
    Nebula,
    /// `ouster_ros/PacketMsg`, also `ouster_sensor_msgs`: one packet without a stamp.
    Ouster,
}

/// The packets of a message.
pub(crate) struct Packets<'a> {
    /// Frame of the message, if it has one.
    pub frame: Option<String>,
    /// Packets with the times of their reception, ns since the Unix epoch.
    pub packets: Vec<(i64, &'a [u8])>,
}

const VELODYNE_BYTES: usize = 1206;
const PANDAR_BYTES: usize = 1500;

impl PacketsKind {
    /// Layout of a type; `None` for other types.
    pub fn from_type(kind: &str) -> Option<Self> {
        match kind {
            "velodyne_msgs/VelodyneScan" => Some(Self::Velodyne),
            "pandar_msgs/PandarScan" | "hesai_lidar/PandarScan" => Some(Self::Pandar),
            "nebula_msgs/NebulaPackets" => Some(Self::Nebula),
            "ouster_ros/PacketMsg" | "ouster_sensor_msgs/PacketMsg" => Some(Self::Ouster),
            _ => None,
        }
    }

    /// The packets of a message.
    pub fn read<'a>(self, c: &mut Cursor<'a>, received: i64) -> Result<Packets<'a>, MessageFault> {
        if self == Self::Ouster {
            return Ok(Packets { frame: None, packets: vec![(received, c.blob("buf")?)] });
        }
        let header = Header::read(c)?;
        let n = c.length("packets", size_of::<u64>())?;
        let packets = (0..n).map(|_| self.packet(c, received)).collect::<Result<_, _>>()?;
        Ok(Packets { frame: Some(header.frame), packets })
    }

    fn packet<'a>(self, c: &mut Cursor<'a>, received: i64) -> Result<(i64, &'a [u8]), MessageFault> {
        let stamp = match c.time("packets.stamp")? {
            0 => received,
            stamp => stamp,
        };
        let data = match self {
            Self::Velodyne => c.bytes("packets.data", VELODYNE_BYTES)?,
            Self::Nebula | Self::Ouster => c.blob("packets.data")?,
            Self::Pandar => {
                let buffer = c.bytes("packets.data", PANDAR_BYTES)?;
                let size = c.u32("packets.size")? as usize;
                let rule = || MessageFault::Rule(format!("packets.size {size} must be at most {PANDAR_BYTES}"));
                buffer.get(..size).ok_or_else(rule)?
            }
        };
        Ok((stamp, data))
    }
}
