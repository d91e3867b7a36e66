//! Point clouds.

use bytes::Bytes;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud, Pose, Quaternion, Timestamp, Vector3};
use messages::{Pod, SweepPoint};

/// The time of a stamp; before 1970 or after 2106, the nearest time that Foxglove supports.
pub fn timestamp(stamp_nanos: i64) -> Timestamp {
    let seconds = stamp_nanos.div_euclid(1_000_000_000).clamp(0, u32::MAX.into());
    Timestamp::new(seconds as u32, stamp_nanos.rem_euclid(1_000_000_000) as u32)
}

/// A pose in Foxglove's numbers.
pub fn pose(pose: &geometry::Pose) -> Pose {
    let t = pose.translation.vector;
    let q = pose.rotation.coords;
    Pose {
        position: Some(Vector3 { x: t.x, y: t.y, z: t.z }),
        orientation: Some(Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }),
    }
}

/// A point of a submap with its columns; packed without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShownPoint {
    /// Position in the submap frame, m.
    pub position: [f32; 3],
    /// Color: sRGB and opacity.
    pub color: [u8; 4],
    /// Intensity in units of the device.
    pub intensity: u8,
    /// Class id.
    pub class: u8,
    /// Score: 0 to 255 for 0 to 1.
    pub score: u8,
    /// Whether it is on a moving object.
    pub moving: bool,
    /// Instance, 0 = none.
    pub instance: u32,
}

const FIELDS: [(&str, u32, NumericType); 12] = [
    ("x", 0, NumericType::Float32),
    ("y", 4, NumericType::Float32),
    ("z", 8, NumericType::Float32),
    ("red", 12, NumericType::Uint8),
    ("green", 13, NumericType::Uint8),
    ("blue", 14, NumericType::Uint8),
    ("alpha", 15, NumericType::Uint8),
    ("intensity", 16, NumericType::Uint8),
    ("class", 17, NumericType::Uint8),
    ("score", 18, NumericType::Uint8),
    ("moving", 19, NumericType::Uint8),
    ("instance", 20, NumericType::Uint32),
];
const POINT_BYTES: u32 = 24;

/// Points of a submap in the frame `frame_id`.
pub fn submap_cloud(
    stamp: i64,
    frame_id: &str,
    frame_from_submap: &geometry::Pose,
    points: &[ShownPoint],
) -> PointCloud {
    let mut data = Vec::with_capacity(points.len() * POINT_BYTES as usize);
    for point in points {
        point.position.iter().for_each(|value| data.extend(value.to_le_bytes()));
        data.extend(point.color);
        data.extend([point.intensity, point.class, point.score, u8::from(point.moving)]);
        data.extend(point.instance.to_le_bytes());
    }
    PointCloud {
        timestamp: Some(timestamp(stamp)),
        frame_id: frame_id.to_owned(),
        pose: Some(pose(frame_from_submap)),
        point_stride: POINT_BYTES,
        fields: fields(&FIELDS),
        data: Bytes::from(data),
    }
}

/// A sweep in the frame of its lidar: the bytes of its rows.
pub fn sweep_cloud(stamp: i64, frame_id: &str, rows: &[u8]) -> PointCloud {
    let numbers = |kind: &str| match kind {
        "f32" => Some(NumericType::Float32),
        "u32" => Some(NumericType::Uint32),
        "u16" => Some(NumericType::Uint16),
        "u8" => Some(NumericType::Uint8),
        _ => None,
    };
    let mut described = Vec::new();
    SweepPoint::describe("", 0, &mut described);
    let of_row = described
        .iter()
        .filter_map(|field| Some((field.name.as_str(), field.offset as u32, numbers(field.kind.as_ref())?)));
    PointCloud {
        timestamp: Some(timestamp(stamp)),
        frame_id: frame_id.to_owned(),
        pose: Some(pose(&geometry::Pose::identity())),
        point_stride: size_of::<SweepPoint>() as u32,
        fields: fields(&of_row.collect::<Vec<_>>()),
        data: Bytes::copy_from_slice(rows),
    }
}

fn fields(table: &[(&str, u32, NumericType)]) -> Vec<PackedElementField> {
    let field = |(name, offset, kind): &(&str, u32, NumericType)| PackedElementField {
        name: (*name).to_owned(),
        offset: *offset,
        r#type: *kind as i32,
    };
    table.iter().map(field).collect()
}
