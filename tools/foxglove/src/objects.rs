//! Boxes around instances.

use crate::clouds::{ShownPoint, pose, timestamp};
use crate::submaps::ShownSubmap;
use foxglove::messages::{Color, CubePrimitive, KeyValuePair, SceneEntity, SceneUpdate, Vector3};
use geometry::{Isometry3, OrientedRectangle, UnitQuaternion};
use messages::class_name;
use std::collections::BTreeMap;

/// Boxes of smaller objects are not drawn, m.
const SMALLEST_M: f64 = 0.05;
const COLOR: Color = Color { r: 1.0, g: 0.65, b: 0.1, a: 0.3 };

/// The boxes of the instances of a submap: upright, around the shown points. An instance that continues in another submap gets
/// the box of the later one.
pub fn boxes(submap: &ShownSubmap, frame_id: &str) -> SceneUpdate {
    let mut of_instance: BTreeMap<u32, Vec<&ShownPoint>> = BTreeMap::new();
    for point in submap.points.iter().filter(|point| point.instance != 0) {
        of_instance.entry(point.instance).or_default().push(point);
    }
    let entity = |(id, points): (u32, Vec<&ShownPoint>)| {
        Some(SceneEntity {
            timestamp: Some(timestamp(submap.stamp)),
            frame_id: frame_id.to_owned(),
            id: id.to_string(),
            metadata: vec![KeyValuePair {
                key: "class".to_owned(),
                value: class_name(most_frequent(&points)).to_owned(),
            }],
            cubes: vec![cube(submap, &points)?],
            ..SceneEntity::default()
        })
    };
    SceneUpdate { deletions: Vec::new(), entities: of_instance.into_iter().filter_map(entity).collect() }
}

fn cube(submap: &ShownSubmap, points: &[&ShownPoint]) -> Option<CubePrimitive> {
    let in_plane: Vec<[f64; 2]> =
        points.iter().map(|point| [point.position[0].into(), point.position[1].into()]).collect();
    let OrientedRectangle { center: [x, y], length_m, width_m, heading } = OrientedRectangle::around(&in_plane)?;
    let heights = || points.iter().map(|point| f64::from(point.position[2]));
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, heading);
    let submap_from_box = Isometry3::from_parts([x, y, 0.5 * (low + high)].into(), turn);
    let [x, y, z] = [length_m, width_m, high - low].map(|side| side.max(SMALLEST_M));
    Some(CubePrimitive {
        pose: Some(pose(&(submap.odom_from_submap * submap_from_box))),
        size: Some(Vector3 { x, y, z }),
        color: Some(COLOR),
    })
}

fn most_frequent(points: &[&ShownPoint]) -> u8 {
    let mut counts = [0_usize; 256];
    for point in points {
        counts[usize::from(point.class)] += 1;
    }
    (0..=u8::MAX).max_by_key(|class| (counts[usize::from(*class)], u8::MAX - class)).unwrap_or_default()
}
