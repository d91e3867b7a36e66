//! The seven classes that domain-generalization papers score, with the maps of LiDOG (Saltori et al., ICCV 2023).
//!
//! The maps of truth come from its repository, `utils/datasets/_resources/{synth4d,semantickitti}2common.yaml`: Synth4D has the
//! class table of this project. Classes without a counterpart are not scored. A network of seven classes cannot predict
//! `traffic-light` or `static`; a model of this project can, and both count as manmade.

use messages::ClassId::{
    self, Bridge, Building, Fence, GuardRail, Pedestrian, Pole, RailTrack, Road, RoadLine, Sidewalk, Static, Terrain,
    TrafficLight, TrafficSign, Vegetation, Vehicles, Wall,
};

/// Names of the classes; the last one stands for predictions of other classes.
pub const NAMES: [&str; 8] =
    ["vehicle", "person", "road", "sidewalk", "terrain", "manmade", "vegetation", "none of the seven"];

/// Number of the scored classes.
pub const N: usize = 7;

const VEHICLE: usize = 0;
const PERSON: usize = 1;
const ROAD: usize = 2;
const SIDEWALK: usize = 3;
const TERRAIN: usize = 4;
const MANMADE: usize = 5;
const VEGETATION: usize = 6;

/// The class of a true class; `None` if it is not scored.
pub fn from_truth(class: u8) -> Option<usize> {
    Some(match ClassId::from_id(class)? {
        Vehicles => VEHICLE,
        Pedestrian => PERSON,
        Road | RoadLine => ROAD,
        Sidewalk => SIDEWALK,
        Terrain => TERRAIN,
        Building | Fence | Wall | Pole | TrafficSign | Bridge | RailTrack | GuardRail => MANMADE,
        Vegetation => VEGETATION,
        _ => return None,
    })
}

/// Number of the seven classes that a predicted class id counts as; [`N`] for ids outside of the seven.
pub fn from_prediction(class: u8) -> usize {
    match ClassId::from_id(class) {
        Some(TrafficLight | Static) => MANMADE,
        _ => from_truth(class).unwrap_or(N),
    }
}

/// The class of an id of SemanticKITTI's benchmark, 0 to 19; `None` if it is not scored: cars are the only scored vehicles, and
/// riders are not scored.
pub fn from_benchmark_id(id: u32) -> Option<usize> {
    Some(match id {
        1 => VEHICLE,
        6 => PERSON,
        9 | 10 => ROAD,
        11 => SIDEWALK,
        13 | 14 | 18 | 19 => MANMADE,
        15 | 16 => VEGETATION,
        17 => TERRAIN,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::semantic_kitti::CLASS_OF_BENCHMARK_ID;

    #[test]
    fn both_maps_agree_where_benchmark_class_is_scored() {
        for (id, class) in (0..).zip(CLASS_OF_BENCHMARK_ID) {
            if let Some(scored) = from_benchmark_id(id) {
                assert_eq!(from_truth(class as u8), Some(scored), "id {id}");
            }
        }
        let n_scored = (0..20).filter(|id| from_benchmark_id(*id).is_some()).count();
        assert_eq!(n_scored, 12);
    }

    #[test]
    fn predictions_beyond_the_seven_are_wrong_or_manmade() {
        let by_truth = |class: ClassId| from_truth(class as u8);
        assert_eq!([Static, TrafficLight, ClassId::Ground, ClassId::Unlabeled].map(by_truth), [None; 4]);
        let by_prediction = |class: ClassId| from_prediction(class as u8);
        assert_eq!([Static, TrafficLight, ClassId::Ground, ClassId::Unlabeled].map(by_prediction), [5, 5, N, N]);
        assert!(
            ClassId::ALL
                .iter()
                .all(|class| from_truth(*class as u8).is_none_or(|of| of == from_prediction(*class as u8)))
        );
    }
}
