//! What does not belong to the static world: moving points and objects that can move.

use geometry::OrientedRectangle;
use messages::{ClassId, GROUND_CLASSES};
use serde::Serialize;
use std::collections::HashMap;
use surveying::CloudPoint;
use surveying::objects::ObjectSummary;

/// Why a point is not in the static world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removed {
    /// It is on a moving object.
    Moving,
    /// Its object or its class can move: vehicles, people.
    Movable,
}

/// Numbers of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RemovedPoints {
    /// On moving objects.
    pub moving: u64,
    /// Points of vehicles and people that stand.
    pub movable: u64,
}

impl RemovedPoints {
    pub(crate) fn count(&mut self, removed: Removed) {
        match removed {
            Removed::Moving => self.moving += 1,
            Removed::Movable => self.movable += 1,
        }
    }
}

/// Points this far outside of the box of an object belong to it, m: mirrors, and what another class cut off.
const MARGIN_M: f64 = 0.25;
/// Larger boxes are paths of moving objects, or several objects, m: length and width of a lorry.
const MAX_SIZE_M: [f64; 2] = [13.0, 3.5];
/// Side of the cells that name the boxes near them, m.
const CELL_M: f64 = 4.0;

/// The boxes of objects that stand.
#[derive(Default)]
pub struct Boxes {
    boxes: Vec<StandingBox>,
    by_cell: HashMap<[i64; 2], Vec<u32>>,
}

struct StandingBox {
    footprint: OrientedRectangle,
    low_m: f64,
    high_m: f64,
}

impl Boxes {
    /// The boxes of these objects, except boxes that are too large for one object.
    pub fn new(objects: &[ObjectSummary]) -> Self {
        let mut all = Self::default();
        for object in objects {
            let footprint = object.footprint;
            if footprint.length_m > MAX_SIZE_M[0] || footprint.width_m > MAX_SIZE_M[1] {
                continue;
            }
            let reach_m = 0.5 * footprint.length_m.hypot(footprint.width_m) + MARGIN_M;
            let cell = |value: f64| (value / CELL_M).floor() as i64;
            let [x, y] = footprint.center;
            for column in cell(x - reach_m)..=cell(x + reach_m) {
                for row in cell(y - reach_m)..=cell(y + reach_m) {
                    all.by_cell.entry([column, row]).or_default().push(all.boxes.len() as u32);
                }
            }
            all.boxes.push(StandingBox { footprint, low_m: object.low_m, high_m: object.high_m });
        }
        all
    }

    fn contain(&self, [x, y, z]: [f64; 3]) -> bool {
        let cell = [x, y].map(|value| (value / CELL_M).floor() as i64);
        self.by_cell.get(&cell).is_some_and(|near| near.iter().any(|idx| self.boxes[*idx as usize].contains([x, y, z])))
    }
}

impl StandingBox {
    fn contains(&self, [x, y, z]: [f64; 3]) -> bool {
        let OrientedRectangle { center, length_m, width_m, heading } = self.footprint;
        let (sin, cos) = heading.sin_cos();
        let off = [x - center[0], y - center[1]];
        let along = off[0] * cos + off[1] * sin;
        let across = off[1] * cos - off[0] * sin;
        along.abs() <= 0.5 * length_m + MARGIN_M
            && across.abs() <= 0.5 * width_m + MARGIN_M
            && (self.low_m..=self.high_m + MARGIN_M).contains(&z)
    }
}

/// Decides on a point. Objects with a number are vehicles and people ([`messages::InstanceTopic`]); their points are removed even if
/// their class is another, and so is what stands in the box of such an object and is not ground.
pub fn removed(point: &CloudPoint, boxes: &Boxes) -> Option<Removed> {
    let class = ClassId::from_id(point.class);
    if point.is_moving || class == Some(ClassId::Dynamic) {
        return Some(Removed::Moving);
    }
    let can_move = matches!(class, Some(ClassId::Vehicles | ClassId::Pedestrian));
    let is_ground = class.is_some_and(|class| GROUND_CLASSES.contains(&class));
    (can_move || point.instance != 0 || !is_ground && boxes.contain(point.xyz)).then_some(Removed::Movable)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn point(class: ClassId, xyz: [f64; 3]) -> CloudPoint {
        CloudPoint {
            xyz,
            lidar_xyz: [0.0; 3],
            time_s: 0.0,
            frame: 0,
            intensity: 0,
            ring: 0,
            is_moving: false,
            lidar: 0,
            instance: 0,
            class: class as u8,
            rgb: [90, 91, 92],
        }
    }

    #[test]
    fn objects_that_move_or_can_move_are_removed_and_houses_are_not() {
        let footprint = OrientedRectangle { center: [10.0, 0.0], length_m: 4.0, width_m: 2.0, heading: 0.5 };
        let car = ObjectSummary {
            id: 7,
            class: "vehicles",
            n_points: 9,
            n_clouds: 1,
            score: None,
            footprint,
            low_m: 0.2,
            high_m: 1.6,
        };
        let path = OrientedRectangle { center: [0.0, 30.0], length_m: 40.0, width_m: 2.0, heading: 0.0 };
        let boxes = Boxes::new(&[car.clone(), ObjectSummary { footprint: path, ..car }]);
        let at = |class, xyz| removed(&point(class, xyz), &boxes);
        let with =
            |class, is_moving, instance| removed(&CloudPoint { is_moving, instance, ..point(class, [0.0; 3]) }, &boxes);
        assert_eq!(with(ClassId::Building, false, 0), None);
        assert_eq!(with(ClassId::Road, false, 0), None);
        assert_eq!(with(ClassId::Vehicles, false, 0), Some(Removed::Movable));
        assert_eq!(with(ClassId::Road, false, 7), Some(Removed::Movable));
        assert_eq!(with(ClassId::Vehicles, true, 7), Some(Removed::Moving));
        assert_eq!(with(ClassId::Dynamic, false, 0), Some(Removed::Moving));
        let on_roof = [10.0 + 1.9 * 0.5_f64.cos(), 1.9 * 0.5_f64.sin(), 1.7];
        assert_eq!(at(ClassId::Building, on_roof), Some(Removed::Movable));
        assert_eq!(at(ClassId::Building, [10.0, 0.0, 3.0]), None);
        assert_eq!(at(ClassId::Road, on_roof), None);
        assert_eq!(at(ClassId::Pole, [5.0, 30.0, 1.0]), None, "in the path of a moving object");
    }
}
