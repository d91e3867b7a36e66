//! The 23 classes of Paris-CARLA-3D (thesis section 2.6.3), in its order.

use crate::id_table::id_table;

/// Raised when an id changes its meaning.
pub const CLASS_TABLE_VERSION: u64 = 1;

/// A name that is not in the class table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown class {name:?}; known are {}", ClassId::ALL.iter().map(|class| class.name()).collect::<Vec<_>>().join(", "))]
pub struct UnknownClass {
    /// The name.
    pub name: String,
}

impl std::str::FromStr for ClassId {
    type Err = UnknownClass;

    fn from_str(name: &str) -> Result<Self, UnknownClass> {
        Self::from_name(name).ok_or_else(|| UnknownClass { name: name.to_owned() })
    }
}

id_table! {
    /// A class by its id.
    ClassId {
        /// The class is unknown.
        Unlabeled = 0, "unlabeled";
        /// Houses and what is fixed to them.
        Building = 1, "building";
        /// Fences, see-through.
        Fence = 2, "fence";
        /// An object of no other class.
        Other = 3, "other";
        /// People.
        Pedestrian = 4, "pedestrian";
        /// Poles and posts.
        Pole = 5, "pole";
        /// Paint on the road.
        RoadLine = 6, "road-line";
        /// Lanes for cars.
        Road = 7, "road";
        /// Areas for pedestrians.
        Sidewalk = 8, "sidewalk";
        /// Trees, hedges, bushes.
        Vegetation = 9, "vegetation";
        /// Cars, trucks, buses, two-wheelers.
        Vehicles = 10, "vehicles";
        /// Free-standing walls.
        Wall = 11, "wall";
        /// Sign plates.
        TrafficSign = 12, "traffic-sign";
        /// Never hit by a beam.
        Sky = 13, "sky";
        /// Horizontal surface of no other ground class.
        Ground = 14, "ground";
        /// Bridges.
        Bridge = 15, "bridge";
        /// Rails and their bed.
        RailTrack = 16, "rail-track";
        /// Guard rails.
        GuardRail = 17, "guard-rail";
        /// Lights, without their pole.
        TrafficLight = 18, "traffic-light";
        /// Fixed street furniture.
        Static = 19, "static";
        /// Things that may have been moved: bins, trolleys, bags.
        Dynamic = 20, "dynamic";
        /// Water.
        Water = 21, "water";
        /// Grass, soil, sand.
        Terrain = 22, "terrain";
    }
}

/// Classes that support other objects.
pub const GROUND_CLASSES: [ClassId; 6] =
    [ClassId::RoadLine, ClassId::Road, ClassId::Sidewalk, ClassId::Ground, ClassId::RailTrack, ClassId::Terrain];

/// Name of a class id, `"unlabeled"` past the table.
pub fn class_name(id: u8) -> &'static str {
    ClassId::from_id(id).unwrap_or(ClassId::Unlabeled).name()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_convert_both_ways() {
        assert_eq!(ClassId::ALL.len(), 23);
        for (id, &class) in ClassId::ALL.iter().enumerate() {
            assert_eq!(class as usize, id);
            assert_eq!(ClassId::from_id(id as u8), Some(class));
            assert_eq!(ClassId::from_name(class.name()), Some(class));
        }
        assert_eq!(ClassId::from_id(23), None);
    }
}
