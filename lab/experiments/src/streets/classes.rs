//! The sets of classes of the tables.

use messages::ClassId::{
    self, Building, Fence, Pedestrian, Pole, Road, RoadLine, Sidewalk, Static, Terrain, TrafficLight, TrafficSign,
    Vegetation, Vehicles, Wall,
};

/// All classes of table 6.8, and walls, which are frequent in the simulated towns.
pub const ALL: [ClassId; 14] = [
    Fence,
    Pedestrian,
    Pole,
    Vegetation,
    Vehicles,
    Wall,
    TrafficSign,
    TrafficLight,
    Static,
    Building,
    RoadLine,
    Road,
    Sidewalk,
    Terrain,
];
/// Classes of low complexity by section 7.3: large surfaces, and frequent.
pub const SIMPLE: &[ClassId] = &[Building, Road, Sidewalk, Terrain, Vegetation];
/// All classes except ground: M2 of table 6.8, P2 of table 6.12.
pub const NO_GROUND: &[ClassId] = ALL.split_at(10).0;
/// All classes except ground and buildings: M3, P1.
pub const NO_GROUND_AND_BUILDINGS: &[ClassId] = ALL.split_at(9).0;
