//! What does not belong to the static world: moving points and objects that can move.

use messages::ClassId;
use serde::Serialize;
use surveying::CloudPoint;

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
    /// Of vehicles and people that stand.
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

/// Decides on a point. Objects with a number are vehicles and people ([`messages::InstanceTopic`]); their points are removed even if
/// their class is another, as the ground between the wheels.
pub fn removed(point: &CloudPoint) -> Option<Removed> {
    let class = ClassId::from_id(point.class);
    if point.is_moving || class == Some(ClassId::Dynamic) {
        return Some(Removed::Moving);
    }
    let can_move = matches!(class, Some(ClassId::Vehicles | ClassId::Pedestrian));
    (can_move || point.instance != 0).then_some(Removed::Movable)
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
        let with = |class, is_moving, instance| removed(&CloudPoint { is_moving, instance, ..point(class, [0.0; 3]) });
        assert_eq!(with(ClassId::Building, false, 0), None);
        assert_eq!(with(ClassId::Road, false, 0), None);
        assert_eq!(with(ClassId::Vehicles, false, 0), Some(Removed::Movable));
        assert_eq!(with(ClassId::Road, false, 7), Some(Removed::Movable));
        assert_eq!(with(ClassId::Vehicles, true, 7), Some(Removed::Moving));
        assert_eq!(with(ClassId::Dynamic, false, 0), Some(Removed::Moving));
    }
}
